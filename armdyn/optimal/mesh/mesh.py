"""The method `mesh`: the optima of a search on finer meshes, certified, with exact switching times where possible.

With path constraints the motion is replayed, without costates. Where rates are limited it is found from rough curves,
with torques linear in an interval. The mesh satisfies a constraint only at its points; the replay is checked
everywhere, and an excess tightens the constraint.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.mesh.direct import Attempt, solve_on_mesh
from armdyn.optimal.mesh.motion_mesh import MeshWork, finer_knots, mesh_optimum, on_finer_meshes
from armdyn.optimal.mesh.search import SearchResult, distinct, find
from armdyn.optimal.mesh.shooting import replay_on_goal
from armdyn.optimal.polish.polish import Structure, polished
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import arcs_of
from armdyn.optimal.verify.certificate import GOAL_TOLERANCE, LIMIT_TOLERANCE
from armdyn.optimal.verify.optimum import MeshMargins, Optimum, as_replayed, excess, least_slowing
from armdyn.optimal.verify.rollout import dense, replay_of
from armdyn.optimal.verify.within_limits import can_be_slowed
from armdyn.parallel import in_processes
from armdyn.trajectory import Trajectory

_GIVEN_UP = "refinement was given up: its budget of mesh iterations is spent"


def mesh(task: Task, rough: Callable[[Task], Sequence[Trajectory]]) -> tuple[list[Optimum], SearchResult]:
    """Optima by cost on meshes, and the search's statistics.

    Args:
        task: the problem and its settings.
        rough: maps a task with path constraints to guesses that replace the search, if a mesh has a solution near one.
    """
    found = (_near_guesses(task, rough(task)) if task.problem.path_constraint_names else None) or find(task)
    if not found.attempts:
        return [], found
    optima, spent = _best_first(replace(task, intervals=found.mesh), found.attempts)
    left = [attempt.trajectory.duration for attempt in found.attempts[len(optima) :]]
    return optima, replace(found, slower=tuple(left), remark=_GIVEN_UP if spent else found.remark)


def _best_first(task: Task, attempts: Sequence[Attempt]) -> tuple[list[Optimum], bool]:
    """The optima near solutions, best first, until the others cost more; and whether the shared budget is spent."""
    numbers, limited = task.policy.same, bool(task.problem.path_constraint_names)
    # In sequence optima share their motions: most of the work where velocity limits are met.
    alone = bool(np.any(np.isfinite(task.problem.limits.velocity)))
    shared = MeshWork(task.policy)
    optima, cutoff = list[Optimum](), np.inf
    task.progress(f"optimum 1 of {len(attempts)}, about {attempts[0].trajectory.duration:.4f} s")
    jobs = [
        partial(_keeping_constraints, task, one)
        if limited
        else partial(_optimum, task, one, shared if alone else MeshWork(task.policy))
        for one in attempts
    ]
    for k, optimum in enumerate(in_processes(jobs, 1 if alone else task.workers, first_here=True)):
        optima.append(optimum)
        if optimum.usable:
            shared.best = min(shared.best, optimum.cost)
            coarse, cost = attempts[k].cost, optimum.cost
            known = limited or optimum.certificate.ok
            sure = coarse + numbers.error_factor * abs(coarse - cost) if known else np.inf
            cutoff = min(cutoff, sure, numbers.slower * cost)
        left = attempts[k + 1 :]
        if left and (task.stop or left[0].cost > cutoff or shared.left <= 0):
            break
        if left:
            task.progress(f"optimum {k + 2}, about {left[0].trajectory.duration:.4f} s")
    return optima, shared.left <= 0


def _optimum(task: Task, attempt: Attempt, work: MeshWork) -> Optimum:
    """Best motion near a mesh's solution: its bang arcs, else the resolved mesh's motion or its bang arcs."""
    if not attempt.usable:
        last, why = attempt.trajectory, f"did not converge on {attempt.intervals} intervals ({attempt.message})"
        failed = Optimum.of(task.problem, replay_of(task, last), attempt.intervals, None, why)
        return replace(failed, trajectory=last, worst_violation=attempt.worst_violation)
    if task.stop:
        why = f"{task.stop.word} before the arcs were read"
        return Optimum.of(task.problem, replay_on_goal(task, attempt), attempt.intervals, None, why)
    exact = partial(_exact, task, set())
    if (found := exact(attempt)) is not None:
        return found
    motion = mesh_optimum(task, attempt, work, exact)
    if motion is not None and motion.phases is not None:
        return motion
    if motion is None or not motion.certificate.keeps_limits:
        own = Optimum.of(task.problem, replay_on_goal(task, attempt), attempt.intervals)
        return own if motion is None else min(own, motion, key=partial(_rank, task))
    return replace(motion, arcs=arcs_of(task.problem, motion.trajectory, task.policy.arcs))


def _exact(task: Task, solved: set[Structure], mesh: Attempt) -> Optimum | None:
    """The certified motion of a mesh's bang arcs, checked by another integrator; None: there is none."""
    phases = None if task.problem.pays_effort else polished(task, mesh.trajectory, solved)
    if phases is None:
        return None
    found = Optimum.of(task.problem, replay_of(task, phases.torques), mesh.intervals, phases)
    if found.certificate.ok:
        found = as_replayed(task, found)
    return found if found.certificate.ok else None


def _rank(task: Task, optimum: Optimum) -> tuple[bool, float]:
    """Sort key: first the optima that reach the goal within their limits, by duration; then the others, by error."""
    factor, certificate = least_slowing(task.problem, optimum), optimum.certificate
    good = certificate.goal_error <= GOAL_TOLERANCE and factor <= task.policy.same.slower
    error = max(certificate.goal_error, certificate.limit_violation)
    return not good, factor * optimum.trajectory.duration if good else error


def _near_guesses(task: Task, rough: Sequence[Trajectory]) -> SearchResult | None:
    """Distinct solutions on the first mesh near rough motions; None: there is no solution."""
    same = task.policy.same
    attempts = [solve_on_mesh(task, guess, task.intervals, task.fine()) for guess in rough]
    found, iterations = distinct(attempts, same.mesh, same.distance), sum(attempt.iterations for attempt in attempts)
    return SearchResult(tuple(found), mesh=task.intervals, iterations=iterations) if found else None


def _keeping_constraints(task: Task, attempt: Attempt) -> Optimum:
    """Solve finer meshes, and the last again with tightened constraints and a corrected end until its replay keeps all.

    Args:
        task: a problem with path constraints.
        attempt: a usable solution as the initial guess.
    """
    numbers, iterations, tolerance = task.policy.path_constraints, 0, task.policy.motion_mesh.tolerance
    again = replace(task.fine(), barrier=task.policy.program.fine_barrier / 10, tolerance=tolerance)

    def solve(guess: Trajectory, knots: Array) -> Attempt:
        return solve_on_mesh(task, guess, knots.size - 1, again, knots=knots)

    finer = partial(finer_knots, task)
    for one in on_finer_meshes(task, attempt, finer(attempt), solve, finer, numbers.settled):
        attempt, iterations = one, iterations + one.iterations
        task.progress(f"{one.intervals} intervals: {one.trajectory.duration:.6f} s")
    constraints, margins, best = TightenedConstraints.of(task), MeshMargins(), _checked(task, attempt)
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
        attempt, found = tried, _checked(task, tried)
        best = min(found, best, key=partial(_rank_of_constrained, task))
    return replace(best, iterations=iterations)


def _faults(task: Task, optimum: Optimum) -> tuple[bool, bool, bool]:
    """Flags: a constraint is violated; the goal is missed; `_beyond` limits."""
    missed = not optimum.certificate.ends_within(task.policy.path_constraints.near)
    return bool(optimum.missed), missed, _beyond(task, optimum)


def _beyond(task: Task, optimum: Optimum) -> bool:
    """Whether an optimum exceeds limits of position, or of velocity where it cannot be slowed down."""
    velocity, position = excess(task.problem.limits, optimum.trajectory)
    return position > 0 or (velocity > LIMIT_TOLERANCE and not can_be_slowed(task.problem))


def _rank_of_constrained(task: Task, optimum: Optimum) -> tuple[bool, bool, bool, bool, float]:
    """Sort key: kept constraints first, then motions that land, kept limits, goals met well, and durations."""
    violated, missed, beyond = _faults(task, optimum)
    return violated, not optimum.certificate.lands, beyond, missed, optimum.trajectory.duration


def _checked(task: Task, attempt: Attempt) -> Optimum:
    """The replay, sampled densely enough for interpolation in the checks, with its certificate."""
    problem, names = task.problem, ", ".join(task.problem.path_constraint_names)
    replay = replay_of(task, dense(attempt.trajectory, task.policy.path_constraints.slow_samples))
    return Optimum.of(
        problem,
        replay,
        attempt.intervals,
        remark=f"arcs are not resolved, nor Pontryagin's conditions checked, with {names}",
        reports=TightenedConstraints.of(task).check(problem, replay, attempt.passing),
        via_times=tuple(attempt.passing.tolist()),
    )
