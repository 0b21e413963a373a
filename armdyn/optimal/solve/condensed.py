"""One guess on one mesh with few unknowns where that will do, as in the search; else with all."""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.problem.status import Status
from armdyn.optimal.program.condensed import CondensedNlp, build_condensed, has_condensed
from armdyn.optimal.program.unknowns import Scales, bounds, mesh, to_trajectory, to_unknowns, worst_defect
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.solve.direct import prepare, solve_on_mesh
from armdyn.optimal.solve.registry import in_time, solver_for
from armdyn.optimal.solve.solver import NlpData, Solver
from armdyn.optimal.solve.stagewise.solver import Stagewise
from armdyn.optimal.task.scheme import Scheme
from armdyn.optimal.task.solver_settings import SolverSettings
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

_RELAXED = 1e-8
"""What unknowns may exceed their bounds by."""


def condensable(task: Task) -> bool:
    """Whether a search may do with so few unknowns."""
    return has_condensed(task.scheme) and task.policy.program.condensed


def solve_quickly(
    task: Task, guess: Trajectory, intervals: int, settings: SolverSettings, between: bool = True
) -> Attempt:
    """`direct.solve_on_mesh`, by way of the condensed program where that is possible.

    Args:
        task: the problem and its settings.
        guess: where it starts.
        intervals: of the mesh.
        settings: iteration limit, tolerance, verbosity.
        between: a solution that exceeds a limit between the knots is solved again within it there.
    """
    if not condensable(task):
        return solve_on_mesh(task, guess, intervals, settings)
    if between and _on_limits(task, guess):
        return _within(task, guess, intervals, settings)
    attempt, within = _condensed(task, guess, mesh(intervals), settings)
    if within or not between or attempt.status is not Status.SOLVED:
        return attempt
    again = _within(task, attempt.trajectory, intervals, settings)
    return replace(again, iterations=attempt.iterations + again.iterations)


def has_stagewise(task: Task) -> bool:
    """Whether the stagewise method solves the task's programs: it needs none of its own for each mesh."""
    return condensable(task) and isinstance(_solver(task, task.options.intervals, task.fine()), Stagewise)


def solve_on_knots(task: Task, guess: Trajectory, knots: Array, settings: SolverSettings, tie: float = 0.0) -> Attempt:
    """The condensed program on any mesh, within all limits in the middle of the intervals, too.

    Args:
        task: the problem and its settings; `has_stagewise`.
        guess: where it starts.
        knots: of the mesh as parts of the duration, shape (N + 1,).
        settings: iteration limit, tolerance, verbosity.
        tie: see `Scales.weights`.
    """
    attempt, _ = _condensed(task, guess, knots, settings, bounded=True, tie=tie)
    return replace(attempt, knots=knots)


def prepare_quickly(task: Task, intervals: int, settings: SolverSettings) -> None:
    """Build the functions that `solve_quickly` likely needs, unless they are built."""
    if task.stop:
        return
    if condensable(task):
        _solver(task, intervals, settings)
    else:
        prepare(task, intervals, settings)


def _on_limits(task: Task, guess: Trajectory) -> bool:
    """A guess that reaches a position or velocity limit is likely to exceed it between the knots."""
    limits, near = task.problem.limits, task.policy.program.near_limit
    room = near * np.ptp(guess.q, axis=0)
    beyond = np.any((guess.q <= limits.position_lower + room) | (guess.q >= limits.position_upper - room))
    return bool(beyond or np.any(np.abs(guess.v) >= (1 - near) * limits.velocity))


def _within(task: Task, guess: Trajectory, intervals: int, settings: SolverSettings) -> Attempt:
    """An attempt that keeps all limits in the middle of the intervals, too."""
    if not task.stop and isinstance(_solver(task, intervals, settings), Stagewise):
        return _condensed(task, guess, mesh(intervals), settings, bounded=True)[0]
    return solve_on_mesh(task, guess, intervals, settings)


def _condensed(
    task: Task, guess: Trajectory, knots: Array, settings: SolverSettings, bounded: bool = False, tie: float = 0.0
) -> tuple[Attempt, bool]:
    """An attempt, and whether it keeps all limits between the knots, too.

    Args:
        task: the problem and its settings.
        guess: where it starts.
        knots: of the mesh as parts of the duration, shape (N + 1,).
        settings: iteration limit, tolerance, verbosity.
        bounded: whether it has to, which only `Stagewise` can see to.
        tie: see `Scales.weights`.
    """
    intervals = knots.size - 1
    if task.stop:
        return Attempt.unbegun(task.stop, guess, intervals), False
    problem, solver = task.problem, _solver(task, intervals, settings)
    program = solver if isinstance(solver, Stagewise) else solver.program
    scales, layout = Scales.of(problem, guess), program.layout
    full, kept, fractions = layout.full, layout.kept(intervals), np.diff(knots)
    weights = scales.weights(problem.effort_weight, tie)
    parameters = scales.parameters(fractions, weights, task.dynamics.last_body)
    lower, upper = bounds(problem, full, intervals, scales)
    start = np.clip(to_unknowns(guess, full, fractions, scales), lower, upper)[kept]
    equal = np.zeros(2 * full.nv * intervals)
    data = NlpData(start, parameters, (lower[kept], upper[kept]), (equal, equal))
    if bounded and isinstance(solver, Stagewise):
        inner = full.inner_states(intervals)[:, 0]
        result = solver.solve(data, task.stop, (lower[inner].T, upper[inner].T))
    else:
        result = solver.solve(data, task.stop)
    x = layout.expanded(result.x, np.array(program.middles(result.x, parameters)))
    violation = None
    if result.status is not Status.SOLVED:
        defects = solver.equations(result.x, parameters).reshape(intervals, -1)
        violation = worst_defect(problem, full, x, defects, fractions, scales)
    motion = to_trajectory(x, full, fractions, scales, problem.robot.joint_names)
    beyond = np.maximum(lower - x, x - upper)[full.inner_states(intervals)]
    within = bool(np.max(beyond) <= max(settings.tolerance, _RELAXED))
    return Attempt(result.status, result.message, motion, intervals, result.iterations, violation), within


def _solver(task: Task, intervals: int, settings: SolverSettings) -> Stagewise | Solver[CondensedNlp]:
    """The stagewise method where it can be had, else the policy's solver."""

    def build(scheme: Scheme) -> Stagewise | Solver[CondensedNlp]:
        stagewise = Stagewise.of(task.dynamics, scheme, intervals, settings)
        return stagewise or solver_for(task, settings, build_condensed, task.dynamics, scheme, intervals)

    return in_time(task, build)
