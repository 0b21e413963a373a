"""Minimum-time motion: global search, exact switching times, certificate; and the indirect method beside it."""

from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.arcs.arc import Arc, Mode
from armdyn.optimal.gap import TimeOptimality, time_optimality, trajectory_from_path
from armdyn.optimal.indirect.solution import Comparison, IndirectOptions, IndirectSolution, compare_with_direct
from armdyn.optimal.indirect.solve_indirect import solve_indirect
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.proof.certificate import Certificate
from armdyn.optimal.proof.sensitivity import Sensitivities
from armdyn.optimal.task.options import MinimumTimeOptions

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
