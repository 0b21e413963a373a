"""The method `mesh`: the optima of a search on finer meshes, certified, with exact switching times where possible."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.optimal.mesh.candidates import SearchResult, find
from armdyn.optimal.mesh.constrained import keeping_constraints, near_guesses
from armdyn.optimal.mesh.detection import arcs_of
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.mesh.motion_mesh import ResolvedMotions, mesh_optimum
from armdyn.optimal.mesh.shooting import replay_on_goal
from armdyn.optimal.polish.polish import polished
from armdyn.optimal.polish.structure import Structure
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import GOAL_TOLERANCE
from armdyn.optimal.verify.optimum import Optimum, as_replayed, least_slowing, with_adjoint_check
from armdyn.optimal.verify.rollout import replay_of
from armdyn.parallel import in_processes
from armdyn.trajectory import Trajectory

_GIVEN_UP = "refinement was given up: its budget of mesh iterations is spent"


def mesh(task: Task, rough: Callable[[Task], Sequence[Trajectory]]) -> tuple[list[Optimum], SearchResult]:
    """Optima by cost on meshes, and the search's statistics.

    Args:
        task: the problem and its settings.
        rough: maps a task with path constraints to guesses that replace the search, if a mesh has a solution near one.
    """
    found = (near_guesses(task, rough(task)) if task.problem.path_constraint_names else None) or find(task)
    if not found.attempts:
        return [], found
    optima, given_up = _best_first(replace(task, intervals=found.mesh), found.attempts)
    left = [attempt.trajectory.duration for attempt in found.attempts[len(optima) :]]
    return optima, replace(found, slower=tuple(left), remark=_GIVEN_UP if given_up else found.remark)


def _best_first(task: Task, attempts: Sequence[Attempt]) -> tuple[list[Optimum], bool]:
    """The optima near solutions, best first, until the others cost more; and whether the budget is spent."""
    numbers, limited = task.policy.refinement, bool(task.problem.path_constraint_names)
    # In sequence they share resolved motions: most of the work with active velocity limits.
    alone = bool(np.any(np.isfinite(task.problem.limits.velocity)))
    shared = ResolvedMotions(task.policy.motion_mesh) if alone else None
    optima, cutoff = list[Optimum](), np.inf
    task.progress(f"optimum 1 of {len(attempts)}, about {attempts[0].trajectory.duration:.4f} s")
    jobs = [
        partial(keeping_constraints, task, one)
        if limited
        else partial(_optimum, task, one, shared or ResolvedMotions(task.policy.motion_mesh))
        for one in attempts
    ]
    for k, optimum in enumerate(in_processes(jobs, 1 if alone else task.workers, first_here=True)):
        optima.append(optimum)
        if optimum.usable:
            if shared:
                shared.best = min(shared.best, optimum.cost)
            coarse, cost = attempts[k].cost, optimum.cost
            known = limited or optimum.certificate.ok
            sure = coarse + numbers.error_factor * abs(coarse - cost) if known else np.inf
            cutoff = min(cutoff, sure, numbers.slower * cost)
        left = attempts[k + 1 :]
        if left and (task.stop or left[0].cost > cutoff or (shared and shared.spent)):
            break
        if left:
            task.progress(f"optimum {k + 2}, about {left[0].trajectory.duration:.4f} s")
    return optima, shared is not None and shared.spent


def _optimum(task: Task, attempt: Attempt, resolved: ResolvedMotions) -> Optimum:
    """Best motion near a mesh's solution: its bang arcs, else the resolved mesh's motion or its bang arcs."""
    if not attempt.usable:
        last, why = attempt.trajectory, f"did not converge on {attempt.intervals} intervals ({attempt.message})"
        failed = Optimum.of(task.problem, replay_of(task, last), attempt.intervals, None, why)
        return replace(failed, trajectory=last, worst_violation=attempt.worst_violation)
    asked = task.problem.limits.actuators.constant
    if not asked or task.stop:
        why = "torques are linear between knots" if not asked else f"{task.stop.word} before the arcs were read"
        return Optimum.of(task.problem, replay_on_goal(task, attempt), attempt.intervals, None, why)
    exact = partial(_exact, task, set())
    if (found := exact(attempt)) is not None:
        return found
    motion = mesh_optimum(task, attempt, resolved, exact)
    if motion is not None and motion.phases is not None:
        return motion
    if motion is None or not motion.within_limits:
        own = Optimum.of(task.problem, replay_on_goal(task, attempt), attempt.intervals)
        return own if motion is None else min(own, motion, key=partial(_rank, task))
    arcs = arcs_of(task.problem, motion.trajectory, task.policy.arcs)
    return replace(motion, arcs=arcs)


def _exact(task: Task, solved: set[Structure], mesh: Attempt) -> Optimum | None:
    """The certified motion of a mesh's bang arcs, checked by another integrator; None: there is none."""
    phases = None if task.problem.pays_effort else polished(task, mesh.trajectory, solved)
    if phases is None:
        return None
    found = Optimum.of(task.problem, replay_of(task, phases.torques), mesh.intervals, phases)
    if found.certificate.ok:
        found = with_adjoint_check(task, as_replayed(task, found))
    return found if found.certificate.ok else None


def _rank(task: Task, optimum: Optimum) -> tuple[bool, float]:
    """Sort key: first the optima that reach the goal within their limits, by duration; then the others, by error."""
    factor = least_slowing(task, optimum)
    good = optimum.certificate.goal_error <= GOAL_TOLERANCE and factor <= task.policy.refinement.slower
    return not good, factor * optimum.trajectory.duration if good else optimum.error
