"""Minimum-time motion by direct collocation."""

from armdyn.optimal.direct import MinimumTimeOptions, solve_minimum_time
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.rollout import replay_torques
from armdyn.optimal.solution import Solution, Status, Violation

__all__ = [
    "MinimumTimeOptions",
    "MinimumTimeProblem",
    "Solution",
    "Status",
    "Violation",
    "replay_torques",
    "solve_minimum_time",
]
