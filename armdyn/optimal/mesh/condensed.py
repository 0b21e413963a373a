"""Solve one guess on one mesh by the condensed program where it suffices, as in the search; else by the full one.

In the condensed Hermite-Simpson program of the search, forward dynamics give the middle of an interval from its ends,

    x_m = (x_k + x_{k+1}) / 2 + h / 8 (f_k - f_{k+1})

(Betts, Practical Methods for Optimal Control, 2010, section 4.5: compressed against separated).
The middle is eliminated, and the final time is one unknown instead of one per knot: half as many unknowns
and equations, the same solutions, and four fifths of the time per iteration. The price: limits of positions and
velocities hold at the knots only, not in the middle, and path constraints are impossible.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.constraints.rows import IntervalFunctions, differentiated
from armdyn.optimal.mesh.assembly import Block, Program, present_body, program_of
from armdyn.optimal.mesh.direct import Attempt, prepare, solve_on_mesh
from armdyn.optimal.mesh.ipopt import Ipopt, NlpData, ipopt_for
from armdyn.optimal.mesh.layout import CondensedLayout, Layout, Parameters
from armdyn.optimal.mesh.stagewise.solver import Stagewise
from armdyn.optimal.mesh.starts import Guesses
from armdyn.optimal.mesh.unknowns import Scales, bounds, mesh, to_trajectory, to_unknowns, worst_defect
from armdyn.optimal.problem.options import Scheme, SolverSettings
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.optimum import effort_cost
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, kw_only=True, eq=False)
class CondensedNlp(Program):
    """Program of a condensed layout.

    Attributes:
        middles: (w, p) -> states in the middle of the intervals, one column each, shape (2 nv, N).
    """

    middles: ca.Function


def build_condensed(dynamics: Dynamics, scheme: Scheme, intervals: int) -> CondensedNlp:
    """The condensed NLP of an arm; parameters as in `assembly.build_nlp`, equations without the middles'.

    Args:
        dynamics: dynamics with a symbolic last body.
        scheme: a mesh's scheme, not that of arcs.
        intervals: number of intervals N.
    """
    layout, (one, middle) = CondensedLayout(Layout(dynamics.nv, scheme)), _interval(dynamics, scheme)
    block = Block(one, layout.intervals(intervals), Parameters.by_interval(dynamics.nv, intervals))
    program = program_of([block], layout.kept(intervals).size)
    x, p = program.functions["x"], program.functions["p"]
    middles = ca.Function("middles", [x, p], [middle.map(intervals)(*block.arguments(x, p))])
    return CondensedNlp(**vars(program), middles=middles)


@built_once(maxsize=16)
def _interval(dynamics: Dynamics, scheme: Scheme) -> tuple[IntervalFunctions, ca.Function]:
    """Functions of one interval, and its middle's state as a function of unknowns and parameters."""
    n, layout = dynamics.nv, CondensedLayout(Layout(dynamics.nv, scheme))
    y, p = ca.SX.sym("y", layout.width), ca.SX.sym("p", Parameters.size(n))
    by, body = Parameters.of(p, n), present_body(dynamics, p)
    scale = ca.vertcat(ca.repmat(by.length, n, 1), ca.repmat(by.speed, n, 1))
    left, u, right, duration = layout.parts(y)
    h = by.fraction * by.time * duration

    def rate(x: ca.SX) -> ca.SX:
        q, v = by.length * x[layout.full.knot.q], by.speed * x[layout.full.knot.v]
        scaled: ca.SX = ca.vertcat(v, dynamics.aba(q, v, by.effort * u, body)) / scale
        return scaled

    start, end = rate(left), rate(right)
    middle = (left + right) / 2 + h / 8 * (start - end)
    defects = right - left - h / 6 * (start + 4 * rate(middle) + end)
    cost = by.fraction * duration * (1 + ca.dot(by.weights, u**2) / 2)
    functions = differentiated("condensed", y, p, defects, cost, scheme.compile)
    return functions, ca.Function("condensed_middle", [y, p], [middle])


def solve_quickly(
    task: Task, guess: Trajectory, intervals: int, settings: SolverSettings, between: bool = True
) -> Attempt:
    """Like `direct.solve_on_mesh`, by the condensed program if possible.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        intervals: number of intervals of the mesh.
        settings: iteration limit, tolerance, verbosity.
        between: whether a solution that exceeds a limit between the knots is solved again with bounds there.
    """
    if not task.policy.program.condensed:
        return solve_on_mesh(task, guess, intervals, settings)
    near, before = guess, 0
    if not (between and _on_limits(task, guess)):
        attempt, within = _condensed(task, guess, mesh(intervals), settings)
        if within or not between or not attempt.usable:
            return attempt
        near, before = attempt.trajectory, attempt.iterations
    again = solve_on_knots(task, near, mesh(intervals), settings)
    return replace(again, iterations=before + again.iterations, knots=None)


def guess_jobs(
    task: Task, guesses: Guesses, settings: Sequence[tuple[int, SolverSettings]]
) -> list[Callable[[Task], Attempt]]:
    """Jobs that solve guesses, without limits between the knots, as functions of the task.

    Args:
        task: the problem and its settings.
        guesses: initial guesses.
        settings: number of intervals and solver settings for each guess.
    """
    names = task.problem.robot.joint_names
    if not has_stagewise(task):
        alone = partial(solve_quickly, between=False)
        return [
            partial(alone, guess=guesses.motion(k, names), intervals=intervals, settings=one)
            for k, (intervals, one) in enumerate(settings)
        ]
    jobs = dict[int, Callable[[Task], Attempt]]()
    for intervals in {intervals for intervals, _ in settings}:
        which = [k for k, (own, _) in enumerate(settings) if own == intervals]
        for k, program in zip(which, _programs(task, guesses.chosen(which), intervals), strict=True):
            jobs[k] = partial(_begun, guesses, k, program, settings[k][1])
    return [jobs[k] for k in range(len(settings))]


def _begun(guesses: Guesses, k: int, program: "_Program", settings: SolverSettings, task: Task) -> Attempt:
    intervals = program.fractions.size
    if task.stop:
        return Attempt.unbegun(task.stop, guesses.motion(k, task.problem.robot.joint_names), intervals)
    return _solved(task, _solver(task, intervals, settings), program)[0]


def _programs(task: Task, guesses: Guesses, intervals: int) -> "list[_Program]":
    """Condensed programs of guesses on one mesh."""
    layout, weight = _layout(task), task.problem.effort_weight
    starts, fractions = condensed_starts(task.problem, layout, guesses, intervals), np.diff(mesh(intervals))
    return [
        _Program(
            x, one.parameters(fractions, one.weights(weight), task.dynamics.last_body), (low, high), one, fractions
        )
        for x, low, high, one in zip(*starts, strict=True)
    ]


def condensed_starts(
    problem: MinimumTimeProblem, layout: CondensedLayout, guesses: Guesses, intervals: int
) -> tuple[Array, Array, Array, list[Scales]]:
    """Scaled unknowns of the condensed programs of guesses, on a mesh of equal intervals.

    Args:
        problem: the minimum-time problem.
        layout: layout with constant torques in the intervals.
        guesses: the guesses.
        intervals: number of intervals N.

    Returns:
        Initial unknowns, their lower and upper bounds, each of shape (k, unknowns), and the scales of each guess.
    """
    n, N, effort = problem.robot.nv, intervals, Scales.efforts(problem)
    time, ways = guesses.durations, np.ptp(guesses.q, axis=1).max(axis=1)
    scales = [Scales.sized(*sizes, effort) for sizes in zip(time, ways, strict=True)]
    length, speed = (np.array([getattr(one, unit) for one in scales]) for unit in ("length", "speed"))
    unit = np.empty((len(scales), 3 * n * N + 2 * n + 1))  # of x_0, u_0, x_1, …, x_N, T
    at = unit[:, : 3 * n * N].reshape(len(scales), N, 3 * n)
    at[..., :n], at[..., n : 2 * n], at[..., 2 * n :] = length[:, None, None], speed[:, None, None], 1.0
    unit[:, -2 * n - 1 : -n - 1], unit[:, -n - 1 : -1], unit[:, -1] = length[:, None], speed[:, None], 1.0

    knots = time[:, None] * np.concatenate([[0.0], np.cumsum(np.diff(mesh(N)))])
    q, v, _ = guesses.at(knots)
    tau = guesses.at((knots[:, :-1] + knots[:, 1:]) / 2)[2] / effort
    inner = np.concatenate([q[:, :-1], v[:, :-1], tau], axis=2).reshape(len(scales), -1)
    x = np.concatenate([inner, q[:, -1], v[:, -1], np.ones((len(scales), 1))], axis=1) / unit
    # Bounds in rad, rad/s and the torque's scale.
    sides = bounds(problem, layout.full, N, Scales(1.0, 1.0, 1.0, effort))
    lower, upper = (side[layout.kept(N)] / unit for side in sides)
    lower[:, -1] = np.maximum(problem.duration_bound() / time, 1e-3)
    return np.clip(x, lower, upper), lower, upper, scales


def has_stagewise(task: Task) -> bool:
    """Whether the stagewise method is available in time; one solver serves all meshes."""
    return (
        not task.stop
        and task.policy.program.condensed
        and isinstance(_solver(task, task.intervals, task.fine()), Stagewise)
    )


def solve_on_knots(task: Task, guess: Trajectory, knots: Array, settings: SolverSettings, tie: float = 0.0) -> Attempt:
    """Solve on any mesh, with all limits in the middle of the intervals, too: without the stagewise method by IPOPT.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        knots: knots of the mesh as parts of the duration, shape (N + 1,).
        settings: iteration limit, tolerance, verbosity.
        tie: see `Scales.weights`.
    """
    if not has_stagewise(task):
        return solve_on_mesh(task, guess, knots.size - 1, settings, knots=knots, tie=tie)
    attempt, _ = _condensed(task, guess, knots, settings, bounded=True, tie=tie)
    return replace(attempt, knots=knots)


def prepare_quickly(task: Task, intervals: int, settings: SolverSettings) -> None:
    """Build the functions that `solve_quickly` likely needs."""
    if task.stop:
        return
    if task.policy.program.condensed:
        _solver(task, intervals, settings)
    else:
        prepare(task, intervals, settings)


def _on_limits(task: Task, guess: Trajectory) -> bool:
    """Whether a guess reaches a position or velocity limit, and so likely exceeds it between the knots."""
    limits, near = task.problem.limits, task.policy.program.near_limit
    room = near * np.ptp(guess.q, axis=0)
    beyond = np.any((guess.q <= limits.position_lower + room) | (guess.q >= limits.position_upper - room))
    return bool(beyond or np.any(np.abs(guess.v) >= (1 - near) * limits.velocity))


def _condensed(
    task: Task, guess: Trajectory, knots: Array, settings: SolverSettings, bounded: bool = False, tie: float = 0.0
) -> tuple[Attempt, bool]:
    """An attempt, and whether it satisfies all limits between the knots, too.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        knots: knots of the mesh as parts of the duration, shape (N + 1,).
        settings: iteration limit, tolerance, verbosity.
        bounded: whether limits hold between the knots, too; only for `Stagewise`.
        tie: see `Scales.weights`.
    """
    intervals = knots.size - 1
    if task.stop:
        return Attempt.unbegun(task.stop, guess, intervals), False
    problem, solver = task.problem, _solver(task, intervals, settings)
    scales, layout = Scales.of(problem, guess), _layout(task)
    full, kept, fractions = layout.full, layout.kept(intervals), np.diff(knots)
    parameters = scales.parameters(fractions, scales.weights(problem.effort_weight, tie), task.dynamics.last_body)
    lower, upper = bounds(problem, full, intervals, scales)
    start = np.clip(to_unknowns(guess, full, fractions, scales), lower, upper)[kept]
    inner = full.middles(intervals)
    middles = (lower[inner].T, upper[inner].T) if bounded else None
    program = _Program(start, parameters, (lower[kept], upper[kept]), scales, fractions)
    attempt, x = _solved(task, solver, program, middles)
    beyond = np.maximum(lower - x, x - upper)[inner]
    return attempt, bool(np.max(beyond) <= settings.tolerance)


@dataclass(frozen=True, eq=False)
class _Program:
    """A condensed program in numbers: initial unknowns, parameters, bounds, scales, interval fractions."""

    x: Array
    p: Array
    bounds: tuple[Array, Array]
    scales: Scales
    fractions: Array


def _solved(
    task: Task,
    solver: Stagewise | Ipopt[CondensedNlp],
    program: _Program,
    middles: tuple[Array, Array] | None = None,
) -> tuple[Attempt, Array]:
    """An attempt, and the unknowns of the full layout.

    Args:
        task: the problem and its settings.
        solver: solver set up for the program.
        program: the program.
        middles: see `Stagewise.solve`; None: no bounds on the middles.
    """
    problem, layout, fractions, scales = task.problem, _layout(task), program.fractions, program.scales
    full, intervals = layout.full, fractions.size
    equal = np.zeros(2 * full.nv * intervals)
    data = NlpData(program.x, program.p, program.bounds, (equal, equal))
    if isinstance(solver, Stagewise):
        result = solver.solve(data, task.stop, middles)
        x = layout.expanded(result.x, solver.middles(result.x, program.p))
    else:
        result = solver.solve(data, task.stop)
        x = layout.expanded(result.x, np.array(solver.program.middles(result.x, program.p)))
    violation = None
    if result.status is not Status.SOLVED:
        defects = solver.equations(result.x, program.p).reshape(intervals, -1)
        violation = worst_defect(problem, full, x, defects, fractions, scales)
    motion = to_trajectory(x, full, fractions, scales, problem.robot.joint_names)
    effort = effort_cost(problem, motion)
    return Attempt(result.status, result.message, motion, intervals, result.iterations, violation, effort=effort), x


def _layout(task: Task) -> CondensedLayout:
    return CondensedLayout(Layout(task.problem.robot.nv, task.scheme))


def _solver(task: Task, intervals: int, settings: SolverSettings) -> Stagewise | Ipopt[CondensedNlp]:
    """The stagewise method if available, else IPOPT."""

    def build(scheme: Scheme) -> Stagewise | Ipopt[CondensedNlp]:
        stagewise = Stagewise.of(task.dynamics, scheme, intervals, settings)
        return stagewise or ipopt_for(settings, build_condensed, task.dynamics, scheme, intervals)

    return task.in_time(build)
