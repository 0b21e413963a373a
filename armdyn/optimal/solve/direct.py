"""Minimum time by direct collocation and IPOPT."""

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.conditions.condition import Knots
from armdyn.optimal.conditions.demands import Demands, numbers_of, row_bounds
from armdyn.optimal.conditions.legs import Aim, Legs, legs_of
from armdyn.optimal.conditions.rows import Rows, with_rows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.assembly import Layout, Nlp, build_nlp
from armdyn.optimal.program.unknowns import Scales, bounds, to_trajectory, to_unknowns, worst_violation
from armdyn.optimal.solve.ipopt import make_solver
from armdyn.optimal.solve.monitor import Monitor
from armdyn.optimal.task.options import DirectOptions
from armdyn.optimal.task.scheme import Scheme
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_TIE = 1e-2
"""Cost of full torques against the 1 of time on arms of more than three joints, of which some are idle; with a tenth
of it IPOPT takes two to ten times as long."""

_FLAT, _NEARLY_FLAT = 1e-4, 1e-5
"""IPOPT's error at which it may stop once the equations of motion hold: with conditions on the way, or idle joints."""

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
class Attempt:
    """What IPOPT made of one guess on one mesh.

    Attributes:
        status: how it ended.
        message: IPOPT's word for it.
        trajectory: the motion; the last iterate if it did not converge.
        intervals: of the mesh.
        iterations: of IPOPT.
        worst_violation: None if it converged.
        passing: when the motion is at the via points [s], shape (vias,).
    """

    status: Status
    message: str
    trajectory: Trajectory
    intervals: int
    iterations: int
    worst_violation: Violation | None
    passing: Array = field(default_factory=lambda: np.empty(0))


def solve_on_mesh(
    task: Task, guess: Trajectory, intervals: int, settings: DirectOptions, demands: Demands | None = None
) -> Attempt:
    """One call of IPOPT.

    Args:
        task: what is to be solved.
        guess: where it starts.
        intervals: of the mesh, dealt out to the legs between via points.
        settings: iteration limit, tolerance, verbosity.
        demands: how much stricter than the problem to be; None: as strict.
    """
    problem, dynamics = task.problem, task.dynamics
    demands = Demands.of(problem) if demands is None else demands
    rows = demands.rows(problem)
    nlp, solver, monitor = _solver(dynamics, task.scheme, intervals, settings, rows)
    scales, layout = Scales.of(problem, guess), nlp.layout
    legs = legs_of(problem, guess, intervals)
    fractions = np.concatenate([np.diff(mesh(size, layout.nv)) for size in legs.intervals])
    shares = fractions
    if len(legs.intervals) > 1:
        shares = fractions * legs.durations[legs.of] / legs.durations.sum()
    knots = Knots(np.append(0.0, np.cumsum(shares)), (0, *legs.knots.tolist()))
    values = demands.values(problem, knots)
    numbers = scales.parameters(effort_weights(problem, scales), dynamics.last_body)
    parameters = np.concatenate([fractions, numbers, numbers_of(values)])
    lower, upper = bounds(problem, layout, intervals, scales)
    x = to_unknowns(guess, layout, shares, scales)
    _fix_legs(problem, layout, legs, demands.aim, scales, x, lower, upper)
    x = np.clip(x, lower, upper)
    lbg, ubg = (
        np.concatenate(sides)
        for sides in zip(_equations(nlp, legs), row_bounds(rows, values, dynamics, task.scheme, intervals), strict=True)
    )
    monitor.stop = task.stop
    result = solver(x0=x, p=parameters, lbx=lower, ubx=upper, lbg=lbg, ubg=ubg)
    status, word, iterations = outcome(solver, task.stop)
    found = np.array(result["x"]).ravel()
    x = found if np.all(np.isfinite(found)) else x
    violation = None
    if status is not Status.SOLVED:
        g = np.array(solver.get_function("nlp_g")(x, parameters)).ravel()
        # Rows after the equations of motion are not looked at.
        beyond = np.maximum(g - ubg, lbg - g)[: intervals * nlp.defects].reshape(intervals, -1)
        violation = worst_violation(problem, layout, x, beyond, fractions, scales)
    first_knots = np.cumsum((0, *legs.intervals[:-1]))
    own = np.maximum(x[first_knots * (layout.knot + layout.inner) + 2 * layout.nv] * scales.time, 0)
    return Attempt(
        status=status,
        message=word,
        trajectory=to_trajectory(x, layout, fractions, scales, problem.robot.joint_names, legs.intervals),
        intervals=intervals,
        iterations=iterations,
        worst_violation=violation,
        passing=np.cumsum(own)[:-1],
    )


def outcome(solver: ca.Function, stop: Stop) -> tuple[Status, str, int]:
    """How IPOPT ended, in our word and in its own, and its iterations."""
    stats: dict[str, Any] = solver.stats()
    word = str(stats["return_status"])
    status = _IPOPT_STATUS.get(word, Status.FAILED)
    if status is Status.INTERRUPTED and not stop.interrupted:
        status, word = Status.TIME_LIMIT, "time limit reached"
    return status, word.replace("_", " "), int(stats["iter_count"])


def _equations(nlp: Nlp, legs: Legs) -> tuple[Array, Array]:
    """Lower and upper bounds of the equations of motion."""
    lower = np.zeros((nlp.intervals, nlp.defects))
    lower[legs.knots[:-1] - 1, -1] = -np.inf  # every leg has a duration of its own
    return lower.ravel(), -lower.ravel()


def _fix_legs(
    problem: MinimumTimeProblem,
    layout: Layout,
    legs: Legs,
    aim: Aim,
    scales: Scales,
    x: Array,
    lower: Array,
    upper: Array,
) -> None:
    """Write the legs' durations into a guess; via points, and where to aim instead, into the bounds."""
    n, block = layout.nv, layout.knot + layout.inner
    several = len(legs.intervals) > 1
    if several:
        times = np.arange(legs.knots[-1] + 1) * block + 2 * n
        durations = legs.durations[np.append(legs.of, legs.of[-1])] / scales.time
        least = np.maximum(problem.leg_bounds() / scales.time, 1e-3)[np.append(legs.of, legs.of[-1])]
        x[times], lower[times] = durations, least
    offsets = np.broadcast_to(aim.offsets, (len(legs.intervals), n))
    for knot, q, offset in zip(legs.knots, problem.poses[1:], offsets, strict=True):
        if several or np.any(offset):
            lower[knot * block : knot * block + n] = upper[knot * block : knot * block + n] = (
                q + offset
            ) / scales.length
    end = legs.knots[-1] * block + n
    for bound in (lower, upper):
        bound[end : end + n] += np.asarray(aim.end_velocity) / scales.speed


def effort_weights(problem: MinimumTimeProblem, scales: Scales) -> Array:
    """The problem's own, or what decides between the equals of an arm with idle joints, shape (nv,)."""
    own = problem.effort_weight > 0 or problem.robot.nv <= 3
    return scales.weights(problem.effort_weight, 0.0 if own else _TIE)


def mesh(intervals: int, joints: int) -> Array:
    """Knots as parts of the duration, shape (intervals + 1,): even up to three joints, dense at both ends beyond.

    Larger arms reach their velocity limits, and the ramps to and from rest are a thousandth of the motion.
    """
    even = np.linspace(0, 1, intervals + 1)
    return even if joints <= 3 else 0.3 * even + 0.35 * (1 - np.cos(np.pi * even))


def prepare(task: Task, intervals: int, settings: DirectOptions) -> None:
    """Build, if it is not there, what `solve_on_mesh` needs."""
    _solver(task.dynamics, task.scheme, intervals, settings, Demands.of(task.problem).rows(task.problem))


@lru_cache(maxsize=16)
def _solver(
    dynamics: Dynamics, scheme: Scheme, intervals: int, options: DirectOptions, rows: tuple[Rows, ...]
) -> tuple[Nlp, ca.Function, Monitor]:
    nlp = build_nlp(dynamics, scheme, intervals)
    if rows:
        nlp = with_rows(nlp, dynamics, rows)
    chosen: dict[str, float | str] = {"mu_init": options.barrier}
    if rows or dynamics.nv > 3:
        # Some joints are idle, and where they are is the obstacles' business: IPOPT walks on in a flat valley.
        flat = _FLAT if rows else _NEARLY_FLAT
        chosen |= {"acceptable_tol": flat, "acceptable_constr_viol_tol": options.tolerance, "acceptable_iter": 6}
    solver, monitor = make_solver(
        nlp, options.tolerance, options.max_iterations, verbose=options.verbose, options=chosen
    )
    return nlp, solver, monitor
