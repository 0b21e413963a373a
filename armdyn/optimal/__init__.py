"""Minimum-time motion: global search, exact switching times, certificate."""

from typing import TYPE_CHECKING

from armdyn.lazy import facade

if TYPE_CHECKING:
    from armdyn.optimal.answer.solution import Solution
    from armdyn.optimal.arcs.arc import Arc, Mode
    from armdyn.optimal.bound.lower_bound import LowerBound, lower_bound
    from armdyn.optimal.gap import TimeOptimality, time_optimality, trajectory_from_path
    from armdyn.optimal.landing.rollout import replay_torques
    from armdyn.optimal.minimum_time import solve_minimum_time
    from armdyn.optimal.path_constraints.limits.frame_speed import FrameSpeedLimit
    from armdyn.optimal.path_constraints.limits.torque_rate import TorqueRateLimit
    from armdyn.optimal.problem.problem import MinimumTimeProblem
    from armdyn.optimal.problem.status import Status, Violation
    from armdyn.optimal.problem_files import read_problem
    from armdyn.optimal.proof.certificate import Certificate
    from armdyn.optimal.proof.sensitivity import Sensitivities
    from armdyn.optimal.refine.ways import plan_path
    from armdyn.optimal.task.options import MinimumTimeOptions
else:
    __getattr__, __dir__ = facade(
        __name__,
        {
            "answer.solution": "Solution",
            "arcs.arc": "Arc Mode",
            "bound.lower_bound": "LowerBound lower_bound",
            "path_constraints.limits.frame_speed": "FrameSpeedLimit",
            "path_constraints.limits.torque_rate": "TorqueRateLimit",
            "gap": "TimeOptimality time_optimality trajectory_from_path",
            "landing.rollout": "replay_torques",
            "minimum_time": "solve_minimum_time",
            "problem.problem": "MinimumTimeProblem",
            "problem.status": "Status Violation",
            "problem_files": "read_problem",
            "proof.certificate": "Certificate",
            "proof.sensitivity": "Sensitivities",
            "refine.ways": "plan_path",
            "task.options": "MinimumTimeOptions",
        },
    )

__all__ = [
    "Arc",
    "Certificate",
    "FrameSpeedLimit",
    "LowerBound",
    "MinimumTimeOptions",
    "MinimumTimeProblem",
    "Mode",
    "Sensitivities",
    "Solution",
    "Status",
    "TimeOptimality",
    "TorqueRateLimit",
    "Violation",
    "lower_bound",
    "plan_path",
    "read_problem",
    "replay_torques",
    "solve_minimum_time",
    "time_optimality",
    "trajectory_from_path",
]
