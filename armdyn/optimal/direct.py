"""Minimum time by direct collocation and IPOPT."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.ipopt import make_solver
from armdyn.optimal.mesh import Scales, bounds, tie_break, to_trajectory, to_unknowns, worst_violation
from armdyn.optimal.monitor import Monitor, Stop
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.status import Status, Violation
from armdyn.optimal.transcription import Nlp, Scheme, build_nlp
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_TIE = 1e-3
"""Cost of full torques against the 1 of time on arms of more than three joints, of which some are idle."""

_IPOPT_STATUS = {
    "Solve_Succeeded": Status.SOLVED,
    "Solved_To_Acceptable_Level": Status.SOLVED,
    "Infeasible_Problem_Detected": Status.INFEASIBLE,
    "Restoration_Failed": Status.INFEASIBLE,
    "Maximum_Iterations_Exceeded": Status.ITERATION_LIMIT,
    "Maximum_CpuTime_Exceeded": Status.TIME_LIMIT,
    "Maximum_WallTime_Exceeded": Status.TIME_LIMIT,
    "User_Requested_Stop": Status.INTERRUPTED,
}


@dataclass(frozen=True)
class DirectOptions:
    """Of one call of IPOPT.

    Attributes:
        tolerance: on the scaled problem.
        max_iterations: before it gives up.
        verbose: let it print.
        barrier: IPOPT's mu_init, on the scaled problem.
    """

    tolerance: float = 1e-8
    max_iterations: int = 500
    verbose: bool = False
    barrier: float = 0.1


@dataclass(frozen=True)
class Attempt:
    """What IPOPT made of one guess on one mesh."""

    status: Status
    message: str
    trajectory: Trajectory
    intervals: int
    iterations: int
    worst_violation: Violation | None


def solve_on_mesh(
    problem: MinimumTimeProblem,
    guess: Trajectory,
    dynamics: Dynamics,
    scheme: Scheme,
    intervals: int,
    options: DirectOptions,
    stop: Stop,
) -> Attempt:
    """One call of IPOPT.

    Args:
        problem: what is to be solved.
        guess: where it starts.
        dynamics: of the problem's robot.
        scheme: the transcription.
        intervals: of the mesh, all of one length.
        options: iteration limit, tolerance, verbosity.
        stop: asked at every iteration.
    """
    nlp, solver, monitor = _solver(dynamics, scheme, intervals, options)
    scales = Scales.of(problem, guess)
    fractions = np.diff(mesh(intervals, problem.robot.nv))
    parameters = np.concatenate([fractions, scales.parameters(weight_of_effort(problem), dynamics.last_body)])
    lower, upper = bounds(problem, nlp, scales)
    x = np.clip(to_unknowns(guess, nlp.layout, fractions, scales), lower, upper)
    monitor.stop = stop
    result = solver(x0=x, p=parameters, lbx=lower, ubx=upper, lbg=0, ubg=0)
    stats: dict[str, Any] = solver.stats()
    word = str(stats["return_status"])
    status = _IPOPT_STATUS.get(word, Status.FAILED)
    if status is Status.INTERRUPTED and not stop.interrupted:
        status, word = Status.TIME_LIMIT, "time limit reached"
    found = np.array(result["x"]).ravel()
    x = found if np.all(np.isfinite(found)) else x
    g = np.array(solver.get_function("nlp_g")(x, parameters)).ravel()
    landed = status is Status.SOLVED
    return Attempt(
        status=status,
        message=word.replace("_", " "),
        trajectory=to_trajectory(x, nlp.layout, fractions, scales, problem.robot.joint_names),
        intervals=intervals,
        iterations=int(stats["iter_count"]),
        worst_violation=None if landed else worst_violation(problem, nlp, x, g, fractions, scales),
    )


def weight_of_effort(problem: MinimumTimeProblem) -> float:
    """The problem's own, or what decides between the equals of an arm with idle joints [1/(N m)²]."""
    if problem.effort_weight > 0 or problem.robot.nv <= 3:
        return problem.effort_weight
    return tie_break(problem, _TIE)


def mesh(intervals: int, joints: int) -> Array:
    """Knots as parts of the duration, shape (intervals + 1,): even up to three joints, dense at both ends beyond.

    Larger arms reach their velocity limits, and the ramps to and from rest are a thousandth of the motion.
    """
    even = np.linspace(0, 1, intervals + 1)
    return even if joints <= 3 else 0.3 * even + 0.35 * (1 - np.cos(np.pi * even))


def prepare(dynamics: Dynamics, scheme: Scheme, intervals: int, options: DirectOptions) -> None:
    """Build, if it is not there, what `solve_on_mesh` needs."""
    _solver(dynamics, scheme, intervals, options)


@lru_cache(maxsize=16)
def _solver(
    dynamics: Dynamics, scheme: Scheme, intervals: int, options: DirectOptions
) -> tuple[Nlp, ca.Function, Monitor]:
    nlp = build_nlp(dynamics, scheme, intervals)
    solver, monitor = make_solver(
        nlp, options.tolerance, options.max_iterations, verbose=options.verbose, options={"mu_init": options.barrier}
    )
    return nlp, solver, monitor
