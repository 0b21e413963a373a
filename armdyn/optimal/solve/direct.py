"""Minimum time by direct collocation and IPOPT."""

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.exclusive import built_once, one_at_a_time
from armdyn.optimal.conditions.course import PLAIN, Course, Legs, legs_of, path_rows, row_bounds, scene_of
from armdyn.optimal.conditions.rows import PathRows, with_rows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.assembly import Layout, Nlp, build_nlp
from armdyn.optimal.program.unknowns import Scales, bounds, to_trajectory, to_unknowns, worst_violation
from armdyn.optimal.solve.ipopt import make_solver
from armdyn.optimal.solve.monitor import Monitor
from armdyn.optimal.task.options import DirectOptions
from armdyn.optimal.task.scheme import Scheme
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
        taken: it did not converge, but keeps the equations of motion so well that it is taken all the same.
    """

    status: Status
    message: str
    trajectory: Trajectory
    intervals: int
    iterations: int
    worst_violation: Violation | None
    passing: Array = field(default_factory=lambda: np.empty(0))
    taken: bool = False

    @property
    def usable(self) -> bool:
        """It is a motion of the arm: it converged, or nearly."""
        return self.taken or self.status is Status.SOLVED


def solve_on_mesh(
    problem: MinimumTimeProblem,
    guess: Trajectory,
    dynamics: Dynamics,
    scheme: Scheme,
    intervals: int,
    options: DirectOptions,
    stop: Stop,
    course: Course = PLAIN,
) -> Attempt:
    """One call of IPOPT.

    Args:
        problem: what is to be solved.
        guess: where it starts.
        dynamics: of the problem's robot.
        scheme: the transcription.
        intervals: of the mesh, dealt out to the legs between via points.
        options: iteration limit, tolerance, verbosity.
        stop: asked every few iterations.
        course: how much stricter than the problem to be.
    """
    rows = path_rows(problem, course.points)
    nlp, solver, monitor = _solver(dynamics, scheme, intervals, options, rows)
    scales, layout, n = Scales.of(problem, guess), nlp.layout, problem.robot.nv
    legs = legs_of(problem, guess, intervals)
    fractions = np.concatenate([np.diff(mesh(size, n)) for size in legs.intervals])
    numbers = scales.parameters(effort_weights(problem, scales), dynamics.last_body)
    parameters = np.concatenate([fractions, numbers, scene_of(problem)])
    lower, upper = bounds(problem, nlp.layout, intervals, scales)
    shares = fractions
    if len(legs.intervals) > 1:
        shares = fractions * legs.durations[legs.of] / legs.durations.sum()
    x = to_unknowns(guess, layout, shares, scales)
    _fix_legs(problem, layout, legs, course, scales, x, lower, upper)
    x = np.clip(x, lower, upper)
    when = np.append(0.0, np.cumsum(shares))
    lbg, ubg = row_bounds(problem, nlp, rows, legs, course, scales, when)
    with one_at_a_time:
        monitor.stop = stop
        result = solver(x0=x, p=parameters, lbx=lower, ubx=upper, lbg=lbg, ubg=ubg)
        status, word, iterations = outcome(solver, stop)
    found = np.array(result["x"]).ravel()
    x = found if np.all(np.isfinite(found)) else x
    g = np.array(solver.get_function("nlp_g")(x, parameters)).ravel()
    landed = status is Status.SOLVED
    # Rows after the equations of motion are not looked at.
    beyond = np.maximum(g - ubg, lbg - g)[: intervals * nlp.defects].reshape(intervals, -1)
    own = np.maximum(x[np.cumsum((0, *legs.intervals[:-1])) * (layout.knot + layout.inner) + 2 * n] * scales.time, 0)
    return Attempt(
        status=status,
        message=word,
        trajectory=to_trajectory(x, layout, fractions, scales, problem.robot.joint_names, legs.intervals),
        intervals=intervals,
        iterations=iterations,
        worst_violation=None if landed else worst_violation(problem, layout, x, beyond, fractions, scales),
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


def _fix_legs(
    problem: MinimumTimeProblem,
    layout: Layout,
    legs: Legs,
    course: Course,
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
    offsets = np.broadcast_to(course.offsets, (len(legs.intervals), n))
    for knot, q, offset in zip(legs.knots, problem.poses[1:], offsets, strict=True):
        if several or np.any(offset):
            lower[knot * block : knot * block + n] = upper[knot * block : knot * block + n] = (
                q + offset
            ) / scales.length
    end = legs.knots[-1] * block + n
    for bound in (lower, upper):
        bound[end : end + n] += np.asarray(course.end_velocity) / scales.speed


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


def prepare(
    dynamics: Dynamics, scheme: Scheme, intervals: int, options: DirectOptions, rows: PathRows | None = None
) -> None:
    """Build, if it is not there, what `solve_on_mesh` needs; rows: `path_rows` of the problem."""
    _solver(dynamics, scheme, intervals, options, rows)


@built_once(maxsize=16)
def _solver(
    dynamics: Dynamics, scheme: Scheme, intervals: int, options: DirectOptions, rows: PathRows | None
) -> tuple[Nlp, ca.Function, Monitor]:
    nlp = build_nlp(dynamics, scheme, intervals)
    if rows is not None:
        nlp = with_rows(nlp, dynamics, rows)
    chosen: dict[str, float | str] = {"mu_init": options.barrier}
    if rows is not None or dynamics.nv > 3:
        # Some joints are idle, and where they are is the obstacles' business: IPOPT walks on in a flat valley.
        flat = _NEARLY_FLAT if rows is None else _FLAT
        chosen |= {"acceptable_tol": flat, "acceptable_constr_viol_tol": options.tolerance, "acceptable_iter": 6}
    solver, monitor = make_solver(
        nlp, options.tolerance, options.max_iterations, verbose=options.verbose, options=chosen
    )
    return nlp, solver, monitor


_solve_on_mesh = solve_on_mesh


def solve_on_mesh(task, guess, intervals, settings, course=PLAIN):
    return _solve_on_mesh(task.problem, guess, task.dynamics, task.scheme, intervals, settings, task.stop, course)
