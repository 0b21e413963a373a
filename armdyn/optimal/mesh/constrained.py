"""Minimum time with path constraints: obstacles, via points, limits of acceleration, speed and torque rate.

The answer is the resolved mesh's motion, replayed: its arcs, and their certificate, are not resolved. Where rates are
limited it is found from rough curves, with torques linear in an interval. The mesh satisfies a constraint only at its
points; the replay is checked everywhere, and an excess tightens the constraint.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from armdyn.arrays import Array
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.mesh.candidates import SearchResult
from armdyn.optimal.mesh.direct import Attempt, solve_on_mesh
from armdyn.optimal.mesh.motion_mesh import finer_knots, on_finer_meshes
from armdyn.optimal.mesh.multistart import distinct
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import LIMIT_TOLERANCE
from armdyn.optimal.verify.optimum import MeshMargins, Optimum, excess
from armdyn.optimal.verify.rollout import dense, replay_of
from armdyn.optimal.verify.within_limits import can_be_slowed
from armdyn.trajectory import Trajectory


def near_guesses(task: Task, rough: Sequence[Trajectory]) -> SearchResult | None:
    """Distinct solutions on the first mesh near rough motions; None: there is no solution."""
    same = task.policy.same
    attempts = [solve_on_mesh(task, guess, task.intervals, task.fine()) for guess in rough]
    found, iterations = distinct(attempts, same.mesh, same.distance), sum(attempt.iterations for attempt in attempts)
    return SearchResult(tuple(found), mesh=task.intervals, iterations=iterations) if found else None


def keeping_constraints(task: Task, attempt: Attempt) -> Optimum:
    """Solve finer meshes, and the last again with tightened constraints and a corrected end until its replay keeps all.

    Args:
        task: a problem with path constraints.
        attempt: a usable solution as the initial guess.
    """
    numbers, meshes, iterations = task.policy.path_constraints, task.policy.motion_mesh, 0
    again = replace(task.fine(), barrier=task.policy.program.fine_barrier / 10, tolerance=meshes.tolerance)

    def solve(guess: Trajectory, knots: Array) -> Attempt:
        return solve_on_mesh(task, guess, knots.size - 1, again, knots=knots)

    finer = partial(finer_knots, task, numbers=meshes)
    for one in on_finer_meshes(task, attempt, finer(attempt), meshes, solve, finer, numbers.settled):
        attempt, iterations = one, iterations + one.iterations
        task.progress(f"{one.intervals} intervals: {one.trajectory.duration:.6f} s")
    constraints, margins, best = TightenedConstraints.of(task), MeshMargins(), _judged(task, attempt)
    found = best
    for k in range(numbers.rounds):
        task.progress("; ".join((f"round {k + 1}: {attempt.trajectory.duration:.4f} s", *found.missed)))
        if task.stop or not any(_faults(task, found)):
            break
        margins = margins.wider(task, found) if _beyond(task, found) else margins
        constraints = constraints.tightened(task.problem, found.reports)
        constraints = constraints.aimed(task.problem, found.trajectory, attempt.passing)
        within = task if margins == MeshMargins() else margins.task_within(task)
        tried = solve_on_mesh(within, attempt.trajectory, attempt.intervals, again, constraints, attempt.mesh)
        iterations += tried.iterations
        if not tried.usable:
            break
        attempt, found = tried, _judged(task, tried)
        best = min(found, best, key=partial(_rank, task))
    return replace(best, iterations=iterations)


def _faults(task: Task, optimum: Optimum) -> tuple[bool, bool, bool]:
    """Flags: a constraint is violated; the goal is missed; `_beyond` limits."""
    missed = not optimum.certificate.ends_within(task.policy.path_constraints.near)
    return bool(optimum.missed), missed, _beyond(task, optimum)


def _beyond(task: Task, optimum: Optimum) -> bool:
    """Whether an optimum exceeds limits of position, or of velocity where it cannot be slowed down."""
    velocity, position = excess(task, optimum)
    return position > 0 or (velocity > LIMIT_TOLERANCE and not can_be_slowed(task.problem))


def _rank(task: Task, optimum: Optimum) -> tuple[bool, bool, bool, bool, float]:
    """Sort key: kept constraints first, then motions that land, kept limits, goals met well, and durations."""
    violated, missed, beyond = _faults(task, optimum)
    return violated, not optimum.landed, beyond, missed, optimum.trajectory.duration


def _judged(task: Task, attempt: Attempt) -> Optimum:
    """The replay, sampled densely enough for interpolation in the checks, with its certificate."""
    problem, names = task.problem, ", ".join(task.problem.path_constraint_names)
    replay = replay_of(task, dense(attempt.trajectory, task.policy.refinement.slow_samples))
    return Optimum.of(
        problem,
        replay,
        attempt.intervals,
        remark=f"arcs are not resolved, nor Pontryagin's conditions checked, with {names}",
        reports=TightenedConstraints.of(task).check(problem, replay, attempt.passing),
        via_times=tuple(attempt.passing.tolist()),
    )
