"""Minimum time: the optima of a search, refined to arcs and certified, in parallel."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from armdyn.optimal.landing.rollout import replay_of
from armdyn.optimal.problem.status import Budget, Violation
from armdyn.optimal.program.unknowns import doubled
from armdyn.optimal.proof.certificate import certify
from armdyn.optimal.refine.motion_mesh import ResolvedMotions
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.refine.resolve import is_resolved, rank, resolve
from armdyn.optimal.search.candidates import SearchResult, find
from armdyn.optimal.solve.condensed import solve_quickly
from armdyn.optimal.solve.direct import Attempt
from armdyn.optimal.switching.refinement import prepare_switching
from armdyn.optimal.task.task import Task
from armdyn.parallel import in_processes

_GIVEN_UP = "refinement was given up: its budget of integrator steps and mesh iterations is spent"


def minimum_time(task: Task) -> tuple[list[Optimum], SearchResult]:
    """Optima with arcs, by duration on the mesh, and the search's statistics.

    Args:
        task: without a weight on effort, and without path constraints.
    """
    found = find(task)
    if not found.attempts:
        return [], found
    optima, given_up = refined(task.with_options(intervals=found.mesh), found)
    left = [attempt.trajectory.duration for attempt in found.attempts[len(optima) :]]
    return optima, replace(found, slower=tuple(left), remark=_GIVEN_UP if given_up else found.remark)


def refined(task: Task, found: SearchResult) -> tuple[list[Optimum], bool]:
    """Detect arcs of optima on the first mesh; refine the best on finer ones until one lands or is certified.

    Args:
        task: task with the first mesh as `options.intervals`.
        found: the optima, best first.

    Returns:
        The optima that are worth it, in order, and whether the budget is spent.
    """
    attempts, numbers, options = found.attempts, task.policy.refinement, task.options
    if _reads_arcs(task):
        prepare_switching(task)
    # Once there is an answer, slower optima are refined on one mesh only.
    few, many = options.intervals, options.max_intervals
    # In sequence they share resolved motions: most of the work with active velocity limits.
    alone = bool(np.any(np.isfinite(task.problem.limits.velocity)))
    meshes = task.policy.motion_mesh
    shared = ResolvedMotions(meshes) if alone else None

    def refined_further(k: int) -> _Reached:
        begun = _Reached(attempts[k], shared or ResolvedMotions(meshes), left=numbers.budget * 2 / 3 ** (k + 1))
        return _on_finer_meshes(task, few if k else many, _on_mesh(task, options.intervals, begun))

    optima: list[Optimum] = []
    cutoff = np.inf
    task.progress(f"refining optimum 1 of {len(attempts)}, about {attempts[0].trajectory.duration:.4f} s")
    jobs = [partial(refined_further, k) for k in range(len(attempts))]
    for k, reached in enumerate(in_processes(jobs, 1 if alone else task.workers, first_here=True)):
        landed = any(optimum.landed(options.replay_tolerance) for optimum in optima)
        optima.append(_optimum(task, reached if landed else _on_finer_meshes(task, many, reached)))
        if optima[k].usable(options.replay_tolerance):
            if shared:
                shared.best = min(shared.best, optima[k].cost)
            duration, cost = attempts[k].trajectory.duration, optima[k].cost
            sure = duration + numbers.error_factor * abs(duration - cost) if optima[k].certificate.ok else np.inf
            cutoff = min(cutoff, sure, numbers.slower * cost)
        left = attempts[k + 1 :]
        slower = options.refinements is None and numbers.lists_slower and left and left[0].trajectory.duration > cutoff
        if left and (task.stop or slower or (shared and shared.spent)):
            break
        if left:
            task.progress(f"refining optimum {k + 2}, about {left[0].trajectory.duration:.4f} s")
    return optima, shared is not None and shared.spent


@dataclass(frozen=True, eq=False)
class _Reached:
    """State of one optimum's refinement.

    Attributes:
        guess: the last attempt that converged.
        resolved: resolved motions of the problem.
        mesh: number of intervals of the last mesh; 0: none was tried.
        best: best optimum so far; None: no mesh has converged.
        iterations: iterations over all meshes.
        failure: message and worst violation of the last mesh, if it did not converge.
        left: integrator steps left for its arcs.
    """

    guess: Attempt
    resolved: ResolvedMotions
    mesh: int = 0
    best: Optimum | None = None
    iterations: int = 0
    failure: tuple[str, Violation | None] = ("", None)
    left: float = np.inf


def _on_mesh(task: Task, mesh: int, step: _Reached) -> _Reached:
    """Refine on a mesh of given size; a solution of the search on that mesh is used unchanged."""
    attempt, iterations = step.guess, step.iterations
    if step.mesh or attempt.intervals != mesh:
        attempt = solve_quickly(task, step.guess.trajectory, mesh, task.fine())
        iterations += attempt.iterations
    if not attempt.usable:
        failure = attempt.message, attempt.worst_violation
        return replace(step, mesh=mesh, iterations=iterations, failure=failure)
    best, left = _read(task, attempt, step)
    if step.best is not None and _quality(task, step.best) <= _quality(task, best):
        best = step.best
    return replace(step, guess=attempt, mesh=mesh, best=best, iterations=iterations, failure=("", None), left=left)


def _on_finer_meshes(task: Task, finest: int, step: _Reached) -> _Reached:
    """Refine on finer meshes until an optimum reaches the goal within its limits or is certified."""
    while not (_enough(task, step) or task.stop):
        finer = doubled(step.mesh, finest)
        if finer is None or (step.best is None and step.mesh > task.options.intervals):
            break
        step = _on_mesh(task, finer, step)
    return step


def _reads_arcs(task: Task) -> bool:
    """Whether to detect arcs of attempts: the option is set, and torques are constant in the intervals."""
    return task.options.arcs and task.scheme.control == "constant"


def _read(task: Task, attempt: Attempt, step: _Reached) -> tuple[Optimum, float]:
    """The extremal near a mesh's solution within a budget of integrator steps, and the rest of the budget."""
    motion = attempt.trajectory
    if _reads_arcs(task):
        budget = Budget(task.stop, step.left)
        return replace(resolve(task, attempt, budget, step.resolved), iterations=0), budget.left
    certificate = certify(task.problem, replay_of(task, motion), None, "arcs were not requested")
    return Optimum(motion, certificate, motion.duration, attempt.intervals), step.left


def _enough(task: Task, step: _Reached) -> bool:
    """Whether a finer mesh cannot improve the optimum, or is hopeless."""
    if step.best is None or step.resolved.spent:
        return step.best is not None
    certificate, numbers = step.best.certificate, task.policy.refinement
    landed = step.best.landed(task.options.replay_tolerance)
    if landed and step.left <= numbers.coarse_budget:  # hopeless
        return True
    if numbers.extremal_is_enough and is_resolved(step.best):
        return True
    return certificate.ok or (landed and not task.options.arcs)


def _optimum(task: Task, step: _Reached) -> Optimum:
    """The best optimum of the meshes, or the last attempt if none converged."""
    problem, best = task.problem, step.best
    if best is None:
        motion, (message, violation) = step.guess.trajectory, step.failure
        remark = f"did not converge on {step.mesh} intervals ({message})"
        certificate = certify(problem, replay_of(task, motion), None, remark)
        return Optimum(
            motion, certificate, motion.duration, step.mesh, iterations=step.iterations, worst_violation=violation
        )
    return replace(best, iterations=step.iterations)


def _quality(task: Task, optimum: Optimum) -> tuple[bool, bool, float]:
    return not optimum.certificate.ok, *rank(task, optimum)
