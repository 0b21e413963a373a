"""Solve one guess on one mesh by the condensed program where it suffices, as in the search; else by the full one.

In the condensed Hermite-Simpson program of the search, forward dynamics give the middle of an interval from its ends,

    x_m = (x_k + x_{k+1}) / 2 + h / 8 (f_k - f_{k+1})

(Betts, Practical Methods for Optimal Control, 2010, section 4.5: compressed against separated).
The middle is eliminated, and the final time is one unknown instead of one per knot: half as many unknowns
and equations, the same solutions. The stagewise method solves it, where a compiler is at hand and torques are constant
in the intervals. The price: limits of positions and velocities hold at the knots only, unless those in the middle
become equations again, and path constraints are impossible.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.mesh.direct import Attempt, MeshNlpData, prepare, solve_on_mesh
from armdyn.optimal.mesh.ipopt import NlpData
from armdyn.optimal.mesh.layout import Layout, Parameters, bounds, mesh, to_unknowns
from armdyn.optimal.mesh.stagewise.solver import Stagewise
from armdyn.optimal.mesh.starts import Guesses
from armdyn.optimal.problem.options import SolverSettings
from armdyn.optimal.problem.task import Task
from armdyn.trajectory import Trajectory


def solve_quickly(task: Task, guess: Trajectory, intervals: int, settings: SolverSettings) -> Attempt:
    """Like `direct.solve_on_mesh`, by the condensed program if possible, with limits between the knots if needed.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        intervals: number of intervals of the mesh.
        settings: iteration limit, tolerance, verbosity.
    """
    if (solver := _stagewise(task, intervals, settings)) is None:
        return solve_on_mesh(task, guess, intervals, settings)
    near, before = guess, 0
    if not _on_limits(task, guess):
        (data,) = assemble_condensed(task, Guesses.of(guess), mesh(intervals))
        attempt, within = _solved(task, solver, data)
        if within or not attempt.usable:
            return attempt
        near, before = attempt.trajectory, attempt.iterations
    again = solve_on_knots(task, near, mesh(intervals), settings)
    return replace(again, iterations=before + again.iterations, knots=None)


def guess_jobs(
    task: Task, guesses: Guesses, settings: Sequence[tuple[int, SolverSettings]]
) -> list[Callable[[Task], Attempt]]:
    """Jobs that solve guesses as functions of the task; by the condensed program without limits between the knots.

    Args:
        task: the problem and its settings.
        guesses: initial guesses.
        settings: number of intervals and solver settings for each guess.
    """
    names = task.problem.robot.joint_names
    if not has_stagewise(task):
        return [
            partial(solve_on_mesh, guess=guesses.motion(k, names), intervals=intervals, settings=one)
            for k, (intervals, one) in enumerate(settings)
        ]
    jobs = dict[int, Callable[[Task], Attempt]]()
    for intervals in {intervals for intervals, _ in settings}:
        which = [k for k, (own, _) in enumerate(settings) if own == intervals]
        for k, data in zip(which, assemble_condensed(task, guesses.chosen(which), mesh(intervals)), strict=True):
            jobs[k] = partial(_solved_guess, guesses, k, data, settings[k][1])
    return [jobs[k] for k in range(len(settings))]


def _solved_guess(guesses: Guesses, k: int, data: MeshNlpData, settings: SolverSettings, task: Task) -> Attempt:
    intervals = data.legs[0]
    if (solver := _stagewise(task, intervals, settings)) is None:  # stopped, or out of time, since `guess_jobs`
        return solve_on_mesh(task, guesses.motion(k, task.problem.robot.joint_names), intervals, settings)
    return _solved(task, solver, data)[0]


def assemble_condensed(task: Task, guesses: Guesses, knots: Array, tie: float = 0.0) -> list[MeshNlpData]:
    """Data of the condensed programs of guesses on one mesh, in the full layout.

    Args:
        task: the problem and its settings.
        guesses: the guesses.
        knots: knots of the mesh as parts of the duration, shape (N + 1,).
        tie: see `Parameters.sized`.
    """
    layout, by = Layout(task.problem.robot.nv, task.scheme), Parameters.sized(task, guesses, np.diff(knots), tie)
    (lower, upper), equal = bounds(task.problem, layout, by), np.zeros(2 * layout.nv * (knots.size - 1))
    x = np.clip(to_unknowns(guesses, layout, by), lower, upper)
    return [
        MeshNlpData(x[k], own.packed(), (lower[k], upper[k]), (equal, equal), layout, (knots.size - 1,), own)
        for k, own in enumerate(by.each())
    ]


def _solved(task: Task, solver: Stagewise, data: MeshNlpData, bounded: bool = False) -> tuple[Attempt, bool]:
    """An attempt by the stagewise method, and whether it satisfies all limits between the knots, too.

    Args:
        task: the problem and its settings.
        solver: the method for the mesh.
        data: the program.
        bounded: whether limits hold between the knots, too.
    """
    layout, N, (lower, upper) = data.layout, data.legs[0], data.x_bounds
    kept, inner = layout.condensed(N), layout.middles(N)
    program = NlpData(data.x[kept], data.p, (lower[kept], upper[kept]), data.g_bounds)
    result = solver.solve(program, task.stop, (lower[inner], upper[inner]) if bounded else None)
    defects, middles = solver.values(result.x, data.p)
    x = np.empty(data.x.size)
    x[kept], x[layout.times(N)], x[inner] = result.x, result.x[-1], middles
    within = np.max(np.maximum(lower - x, x - upper)[inner]) <= solver.settings.tolerance
    return data.attempt(task.problem, result, x, defects), bool(within)


def has_stagewise(task: Task) -> bool:
    """Whether the stagewise method is available in time; one solver serves all meshes."""
    return _stagewise(task, task.intervals, task.fine()) is not None


def solve_on_knots(task: Task, guess: Trajectory, knots: Array, settings: SolverSettings, tie: float = 0.0) -> Attempt:
    """Solve on any mesh, with all limits in the middle of the intervals, too: without the stagewise method by IPOPT.

    Args:
        task: the problem and its settings.
        guess: initial guess.
        knots: knots of the mesh as parts of the duration, shape (N + 1,).
        settings: iteration limit, tolerance, verbosity.
        tie: see `Parameters.sized`.
    """
    if (solver := _stagewise(task, knots.size - 1, settings)) is None:
        return solve_on_mesh(task, guess, knots.size - 1, settings, knots=knots, tie=tie)
    (data,) = assemble_condensed(task, Guesses.of(guess), knots, tie)
    return replace(_solved(task, solver, data, bounded=True)[0], knots=knots)


def prepare_quickly(task: Task, intervals: int, settings: SolverSettings) -> None:
    """Build the functions that `solve_quickly` likely needs."""
    if _stagewise(task, intervals, settings) is None:
        prepare(task, intervals, settings)


def _on_limits(task: Task, guess: Trajectory) -> bool:
    """Whether a guess reaches a position or velocity limit, and so likely exceeds it between the knots."""
    limits, near = task.problem.limits, task.policy.program.near_limit
    room = near * np.ptp(guess.q, axis=0)
    beyond = np.any((guess.q <= limits.position_lower + room) | (guess.q >= limits.position_upper - room))
    return bool(beyond or np.any(np.abs(guess.v) >= (1 - near) * limits.velocity))


def _stagewise(task: Task, intervals: int, settings: SolverSettings) -> Stagewise | None:
    """The stagewise method, if available in time."""
    if task.stop or not task.policy.program.condensed:
        return None
    return task.in_time(lambda scheme: Stagewise.of(task.dynamics, scheme, intervals, settings))
