"""Outcomes that several tests of tables look at."""

import pytest

from armdyn.paper.outcomes.case import Case
from armdyn.paper.printed.examples import PAYLOADS
from paper.computed import outcome
from paper.references import READINGS


@pytest.fixture(scope="module")
def r_loops():
    """Example 4 in both readings, all payloads."""
    return [outcome(Case(4, "r", "pid", m, reading)) for reading in READINGS for m in PAYLOADS]
