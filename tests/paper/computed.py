"""Outcomes that several tests look at, each computed once."""

from functools import cache

from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.run import run_case

outcome = cache(run_case)

CASES = (
    Case(1, "r", "minimum_time", 0.1006),
    Case(1, "r", "minimum_time", 1.0),
    Case(1, "r", "time_energy", 0.1006),
    *(Case(4, "r", "pid", mass, reading) for mass in (0.0212, 0.1006, 1.0) for reading in ("tip", "mM")),
    *(Case(5, "rr", "pid", mass, reading) for mass in (0.1006, 1.0) for reading in ("tip", "mM")),
    *(Case(6, "rrr", "pid", 0.1006, reading) for reading in ("tip", "mM")),
    Case(6, "rrr", "pid", 0.1006, "mM", "printed"),
)


def outcomes():
    """Of R everything, of RR and RRR the PID loops, which take no search."""
    return [outcome(case) for case in CASES]
