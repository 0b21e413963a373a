"""Minimum-time motion: global search, exact switching times, certificate; and the indirect method beside it."""

from armdyn.optimal.arcs import Arc, Mode
from armdyn.optimal.certificate import Certificate
from armdyn.optimal.gap import TimeOptimality, time_optimality, trajectory_from_path
from armdyn.optimal.indirect import solve_indirect
from armdyn.optimal.indirect_solution import Comparison, IndirectOptions, IndirectSolution, compare_with_direct
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.options import MinimumTimeOptions
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.rollout import replay_torques
from armdyn.optimal.sensitivity import Sensitivities
from armdyn.optimal.solution import Solution
from armdyn.optimal.status import Status, Violation

__all__ = [
    "Arc",
    "Certificate",
    "Comparison",
    "IndirectOptions",
    "IndirectSolution",
    "MinimumTimeOptions",
    "MinimumTimeProblem",
    "Mode",
    "Sensitivities",
    "Solution",
    "Status",
    "TimeOptimality",
    "Violation",
    "compare_with_direct",
    "replay_torques",
    "solve_indirect",
    "solve_minimum_time",
    "time_optimality",
    "trajectory_from_path",
]
