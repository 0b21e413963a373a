"""Minimum time with path constraints: obstacles, via points, limits of acceleration, speed and torque rate.

The answer is the resolved mesh's motion, replayed: its arcs, and their certificate, are not resolved. Where rates are
limited it is found from rough curves, with torques linear in an interval. The mesh satisfies a constraint only at its
points; the replay is checked everywhere, and an excess tightens the constraint.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.mesh.candidates import SearchResult, find
from armdyn.optimal.mesh.direct import Attempt, solve_on_mesh
from armdyn.optimal.mesh.motion_mesh import finer_knots, on_finer_meshes
from armdyn.optimal.mesh.multistart import distinct
from armdyn.optimal.mesh.unknowns import doubled
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import LIMIT_TOLERANCE
from armdyn.optimal.verify.optimum import MeshMargins, Optimum, excess
from armdyn.optimal.verify.rollout import dense, replay_of
from armdyn.optimal.verify.within_limits import can_be_slowed
from armdyn.trajectory import Trajectory


def constrained(task: Task, rough: Sequence[Trajectory] = ()) -> tuple[list[Optimum], SearchResult]:
    """Refine the mesh's optima until they satisfy the path constraints and none left could be faster.

    Args:
        task: a problem with path constraints.
        rough: guesses that replace the search, if the mesh has a solution near one.
    """
    found = _near(task, rough) or find(task)
    optima: list[Optimum] = []
    listed = list(found.listed)
    for attempt in found.attempts:
        best = min((one.trajectory.duration for one in optima if not any(_faults(task, one))), default=np.inf)
        if optima and (task.stop or attempt.trajectory.duration >= best):
            listed.append(attempt.trajectory.duration)
            continue
        task.progress(f"optimum {len(optima) + 1}, about {attempt.trajectory.duration:.4f} s")
        optima.append(refined_again(task, attempt))
    return optima, replace(found, listed=tuple(listed))


def _near(task: Task, rough: Sequence[Trajectory]) -> SearchResult | None:
    """Distinct solutions on the first mesh near rough motions; None: there is no solution."""
    same = task.policy.same
    attempts = [solve_on_mesh(task, guess, task.intervals, task.fine()) for guess in rough]
    found, iterations = distinct(attempts, same.mesh, same.distance), sum(attempt.iterations for attempt in attempts)
    return SearchResult(tuple(found), mesh=task.intervals, iterations=iterations) if found else None


@dataclass(frozen=True, eq=False)
class _Mesh:
    """Specification of the next mesh, with the results of the mesh before.

    Attributes:
        knots: knots as parts of the duration, shape (intervals + 1,).
        constraints: tightened path constraints.
        margins: margins of the limits.
        slowing: factor on the duration that the path constraints required of the mesh before.
        missed: its goal error [rad or m].
    """

    knots: Array
    constraints: TightenedConstraints
    margins: MeshMargins = field(default_factory=MeshMargins)
    slowing: float = np.inf
    missed: float = np.inf


def refined_again(task: Task, attempt: Attempt) -> Optimum:
    """Resolve a mesh, then solve it with terminal correction and tightened constraints until its replay satisfies all.

    Args:
        task: a problem with path constraints.
        attempt: a usable solution as the initial guess.
    """
    numbers, iterations = task.policy.path_constraints, 0
    meshes, barrier = task.policy.motion_mesh, task.policy.program.fine_barrier / 10
    again = replace(task.fine(), barrier=barrier, tolerance=meshes.tolerance)

    def solve(guess: Trajectory, knots: Array) -> Attempt:
        return solve_on_mesh(task, guess, knots.size - 1, again, knots=knots)

    finer = partial(finer_knots, task, numbers=meshes)
    for one in on_finer_meshes(task, attempt, finer(attempt), meshes, solve, finer, numbers.settled):
        attempt, iterations = one, iterations + one.iterations
        task.progress(f"{one.intervals} intervals: {one.trajectory.duration:.6f} s")
    mesh: _Mesh | None = _Mesh(attempt.mesh, TightenedConstraints.of(task))
    best: Optimum | None = None
    for k in range(numbers.rounds):
        if mesh is None:
            break
        if k:
            within = task if mesh.margins == MeshMargins() else mesh.margins.task_within(task)
            tried = solve_on_mesh(within, attempt.trajectory, mesh.knots.size - 1, again, mesh.constraints, mesh.knots)
            iterations += tried.iterations
            if not tried.usable:
                break
            attempt = tried
        replay = _replayed(task, attempt)
        found = _judged(task, replay, attempt)
        best = found if best is None or _rank(task, found) <= _rank(task, best) else best
        task.progress("; ".join((f"round {k + 1}: {attempt.trajectory.duration:.4f} s", *found.missed)))
        mesh = None if task.stop else _next(task, mesh, found, replay, attempt)
    if best is None:
        best = _judged(task, _replayed(task, attempt), attempt)
    return replace(best, iterations=iterations)


def _next(task: Task, mesh: _Mesh, found: Optimum, replay: Trajectory, attempt: Attempt) -> _Mesh | None:
    """Specification of the next mesh; None if the last one is good, or no mesh helps."""
    if not any(_faults(task, found)):
        return None
    numbers, problem, knots = task.policy.path_constraints, task.problem, attempt.mesh
    finer = doubled(attempt.intervals, task.options.max_intervals)
    margins = mesh.margins.wider(task, found) if _beyond(task, found) else mesh.margins
    constraints, slowing = mesh.constraints.tightened(problem, found.reports), found.reports.slowing
    missed = found.certificate.goal_error
    stuck = 0 < numbers.stuck * (mesh.slowing - 1) <= slowing - 1 < np.inf
    astray = missed > numbers.near and missed >= numbers.stuck * mesh.missed
    if missed <= numbers.far and not (finer is not None and (stuck or astray)):
        aimed = constraints.aimed(problem, replay, attempt.passing)
        return _Mesh(knots, aimed, margins, slowing, missed)
    # Else the mesh's solution is no motion of the arm, or too coarse: no correction repairs it.
    halved = np.union1d(knots, (knots[:-1] + knots[1:]) / 2)
    return None if finer is None else _Mesh(halved, constraints.on_finer_mesh(), margins, slowing, missed)


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


def _replayed(task: Task, attempt: Attempt) -> Trajectory:
    """The replay, sampled densely enough for interpolation in the checks."""
    return replay_of(task, dense(attempt.trajectory, task.policy.refinement.slow_samples))


def _judged(task: Task, replay: Trajectory, attempt: Attempt) -> Optimum:
    problem = task.problem
    names, reports = ", ".join(problem.path_constraint_names), TightenedConstraints.of(task)
    return Optimum.of(
        problem,
        replay,
        attempt.intervals,
        remark=f"arcs are not resolved, nor Pontryagin's conditions checked, with {names}",
        reports=reports.check(problem, replay, attempt.passing),
        via_times=tuple(attempt.passing.tolist()),
    )
