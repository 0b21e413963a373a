"""Minimum time by direct collocation and IPOPT."""

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.conditions.course import PLAIN, Course, Legs, legs_of, path_rows, row_bounds, scene_of
from armdyn.optimal.conditions.rows import PathRows, with_rows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.assembly import Nlp, build_nlp
from armdyn.optimal.program.layout import Layout
from armdyn.optimal.program.mesh import mesh
from armdyn.optimal.program.unknowns import Scales, bounds, to_trajectory, to_unknowns, worst_violation
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.solve.ipopt import Ipopt, IpoptSettings
from armdyn.optimal.task.options import DirectOptions
from armdyn.optimal.task.policy import Policy
from armdyn.optimal.task.scheme import Scheme
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


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
    policy = Policy.of(problem)
    solver = _solver(dynamics, scheme, intervals, options, rows, policy)
    nlp, scales = solver.program, Scales.of(problem, guess)
    layout, legs = nlp.layout, legs_of(problem, guess, intervals)
    fractions = np.concatenate([np.diff(mesh(size, policy.graded)) for size in legs.intervals])
    weights = scales.weights(problem.effort_weight, policy.tie)
    parameters = np.concatenate([scales.parameters(fractions, weights, dynamics.last_body), scene_of(problem)])
    lower, upper = bounds(problem, layout, intervals, scales)
    shares = fractions
    if len(legs.intervals) > 1:
        shares = fractions * legs.durations[legs.of] / legs.durations.sum()
    x = to_unknowns(guess, layout, shares, scales)
    _fix_legs(problem, layout, legs, course, scales, x, lower, upper)
    x = np.clip(x, lower, upper)
    when = np.append(0.0, np.cumsum(shares))
    lbg, ubg = row_bounds(problem, nlp, rows, legs, course, scales, when)
    outcome = solver.solve(x, parameters, (lower, upper), (lbg, ubg), stop)
    x, g = outcome.x, solver.equations(outcome.x, parameters)
    landed = outcome.status is Status.SOLVED
    # Rows after the equations of motion are not looked at.
    beyond = np.maximum(g - ubg, lbg - g)[: intervals * nlp.defects].reshape(intervals, -1)
    own = np.maximum(x[layout.times(intervals)[np.append(0, legs.knots[:-1])]] * scales.time, 0)
    return Attempt(
        status=outcome.status,
        message=outcome.message,
        trajectory=to_trajectory(x, layout, fractions, scales, problem.robot.joint_names, legs.intervals),
        intervals=intervals,
        iterations=outcome.iterations,
        worst_violation=None if landed else worst_violation(problem, layout, x, beyond, fractions, scales),
        passing=np.cumsum(own)[:-1],
    )


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
    N, several = int(legs.knots[-1]), len(legs.intervals) > 1
    knots = layout.knots(N)
    if several:
        times = layout.times(N)
        durations = legs.durations[np.append(legs.of, legs.of[-1])] / scales.time
        least = np.maximum(problem.leg_bounds() / scales.time, 1e-3)[np.append(legs.of, legs.of[-1])]
        x[times], lower[times] = durations, least
    offsets = np.broadcast_to(course.offsets, (len(legs.intervals), layout.nv))
    for knot, q, offset in zip(legs.knots, problem.poses[1:], offsets, strict=True):
        if several or np.any(offset):
            place = knots[knot, layout.knot.q]
            lower[place] = upper[place] = (q + offset) / scales.length
    for bound in (lower, upper):
        bound[knots[N, layout.knot.v]] += np.asarray(course.end_velocity) / scales.speed


def prepare(
    dynamics: Dynamics,
    scheme: Scheme,
    intervals: int,
    options: DirectOptions,
    rows: PathRows | None,
    policy: Policy,
) -> None:
    """Build, if it is not there, what `solve_on_mesh` needs; rows: `path_rows` of the problem."""
    _solver(dynamics, scheme, intervals, options, rows, policy)


def _solver(
    dynamics: Dynamics,
    scheme: Scheme,
    intervals: int,
    options: DirectOptions,
    rows: PathRows | None,
    policy: Policy,
) -> Ipopt[Nlp]:
    flat = policy.flat if rows is None else policy.flat_with_rows
    settings = IpoptSettings.of(options)
    if flat is not None:
        settings = IpoptSettings.of(
            options, acceptable_tol=flat, acceptable_constr_viol_tol=options.tolerance, acceptable_iter=6
        )
    return Ipopt.of(settings, _program, dynamics, scheme, intervals, rows)


def _program(dynamics: Dynamics, scheme: Scheme, intervals: int, rows: PathRows | None) -> Nlp:
    nlp = build_nlp(dynamics, scheme, intervals)
    return nlp if rows is None else with_rows(nlp, dynamics, rows)
