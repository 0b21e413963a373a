"""Outcomes that several tests of tables look at."""

import pytest

from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.run import run_case
from armdyn.paper.printed.examples import PAYLOADS
from paper.references import READINGS


@pytest.fixture(scope="module")
def r_loops():
    """Example 4 in both readings, all payloads."""
    return [run_case(Case(4, "r", "pid", m, reading)) for reading in READINGS for m in PAYLOADS]
