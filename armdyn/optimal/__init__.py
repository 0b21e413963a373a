"""Minimum-time motion: global search, exact switching times, certificate."""

from armdyn.optimal.arcs import Arc, Mode
from armdyn.optimal.certificate import Certificate
from armdyn.optimal.gap import TimeOptimality, time_optimality, trajectory_from_path
from armdyn.optimal.minimum_time import MinimumTimeOptions, solve_minimum_time
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.rollout import replay_torques
from armdyn.optimal.sensitivity import Sensitivities
from armdyn.optimal.solution import Solution
from armdyn.optimal.status import Status, Violation

__all__ = [
    "Arc",
    "Certificate",
    "MinimumTimeOptions",
    "MinimumTimeProblem",
    "Mode",
    "Sensitivities",
    "Solution",
    "Status",
    "TimeOptimality",
    "Violation",
    "replay_torques",
    "solve_minimum_time",
    "time_optimality",
    "trajectory_from_path",
]
