"""Outcomes that several tests of tables look at."""

import pytest

from armdyn.models import PAPER_PAYLOADS
from armdyn.studies.paper.outcomes.case import Case
from armdyn.studies.paper.outcomes.run import run_case
from studies.paper.references import READINGS


@pytest.fixture(scope="module")
def r_loops():
    """Example 4 in both readings, all payloads."""
    return [run_case(Case(4, "r", "pid", m, reading)) for reading in READINGS for m in PAPER_PAYLOADS]
