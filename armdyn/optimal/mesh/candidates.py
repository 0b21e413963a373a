"""Choice of the optima to refine: found on coarse meshes, distinguished on a finer one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from armdyn.optimal.mesh.condensed import has_stagewise, prepare_quickly, solve_quickly
from armdyn.optimal.mesh.direct import Attempt, solve_on_mesh
from armdyn.optimal.mesh.multistart import Job, crossover_guesses, distinct, ranked, search
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.mesh.unknowns import doubled
from armdyn.optimal.problem.options import SolverSettings
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.rollout import replay_of
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class SearchResult:
    """Result of a search.

    Attributes:
        attempts: the best optima, best first; none: the search found no motion.
        failed: without any, the failed attempts, best first.
        mesh: number of intervals of the first mesh for arc detection.
        listed: durations of the other optima on coarse meshes [s].
        slower: durations of optima that were distinguished on the finer mesh, and not refined [s].
        iterations: iterations of IPOPT.
        remark: sentence for a motion that is not certified: number of different optima from the guesses, or that
            refinement was abandoned; else empty.
    """

    attempts: tuple[Attempt, ...]
    failed: tuple[Attempt, ...] = ()
    mesh: int = 0
    listed: tuple[float, ...] = ()
    slower: tuple[float, ...] = ()
    iterations: int = 0
    remark: str = ""


def find(task: Task) -> SearchResult:
    """Search from many guesses on coarse meshes, and solve the best on the mesh for arc detection.

    Args:
        task: the problem and its settings.
    """
    options, numbers = task.options, task.policy.search
    same = task.policy.same.coarse, task.policy.same.distance
    count = numbers.guesses(options)
    # Guesses of the options are solved on the fine mesh directly.
    on_mesh = partial(solve_quickly, intervals=task.intervals, settings=task.fine())
    extra_jobs: list[Job] = [partial(on_mesh, guess=guess) for guess in options.guesses]
    task.progress(
        f"search: {count} guesses" + (f", and {len(extra_jobs)} on {task.intervals} intervals" if extra_jobs else "")
    )
    prepare_quickly(task, task.intervals, task.fine())  # before the fork, too
    with task.pooled(has_stagewise(task)) as pooled:
        attempts = _searched(pooled, count, task.policy.search.meshes, extra_jobs)
        fine, coarse = (distinct(some, *same) for some in (attempts[: len(extra_jobs)], attempts[len(extra_jobs) :]))
        found = ranked([*fine, *coarse])  # the finer mesh's are kept apart: they cost no solve
        if not found:
            attempts = _without_search(task, ranked(attempts))
            found = distinct(attempts, *same)
        iterations = sum(attempt.iterations for attempt in attempts)
        if not found:
            return SearchResult((), failed=tuple(attempts), iterations=iterations)
        refined = _told_apart(pooled, found)
    if finer := _too_coarse(task, found, refined):
        iterations, (mesh, meshes, share) = iterations + refined.iterations, finer
        # Meshes err for heavy arms, whose optima are near the straight path.
        near = replace(task, policy=task.policy.changed("search", spread=1.0, uniform_spread=0.0))
        several = count // share if at_speed(task, refined.attempts[0].trajectory) else count
        prepare_quickly(task, mesh, task.fine())
        with replace(near, intervals=mesh).pooled(has_stagewise(near)) as near:
            again = _searched(near, several, meshes, known=refined.attempts)
            found = distinct([*refined.attempts, *again], *same)
            refined = _told_apart(near, found)
        iterations += sum(attempt.iterations for attempt in again)
    return replace(refined, iterations=iterations + refined.iterations)


def _searched(
    task: Task,
    count: int,
    meshes: Sequence[int],
    extra_jobs: Sequence[Job] = (),
    known: Sequence[Attempt] = (),
) -> list[Attempt]:
    """Attempts from guesses through random poses, and from crossover of their optima and of known ones.

    Many guesses are split into several lineages of the default size: a single one forgets all but its best optima.
    """
    changes = round(task.policy.search.mutated * count)
    settings = [(intervals, one) for one in task.coarse() for intervals in meshes]
    attempts = search(task, count - changes, settings, extra_jobs)
    if not changes or len(attempts) < len(extra_jobs) + count - changes:  # early end, or time is up
        return attempts
    nearby = settings[: len(meshes)]  # the smallest barrier stays nearest to a guess
    lineages = max(1, round(count / task.policy.search.starts))
    ends = [changes * k // lineages for k in range(lineages + 1)]
    for k, (first, end) in enumerate(pairwise(ends)):
        ancestors = [*known, *attempts[len(extra_jobs) : len(extra_jobs) + count - changes][k::lineages]]
        attempts = [*attempts, *crossover_guesses(task, ancestors, end - first, nearby, first)]
    return attempts


def _told_apart(task: Task, found: Sequence[Attempt]) -> SearchResult:
    """The best distinct coarse optima, on the first mesh for arc detection and in its order.

    Args:
        task: task with that mesh as `intervals`.
        found: optima, best first.
    """
    settings, most = task.fine(), task.policy.search.refinements(task.options)
    prepare_quickly(task, task.intervals, settings)

    task.progress(f"the best optima, about {found[0].trajectory.duration:.4f} s, on {task.intervals} intervals")
    candidates: list[Attempt] = []
    iterations, solves = 0, most * task.policy.search.fine_solves
    jobs = [partial(_finer, attempt, task.intervals, settings) for attempt in found]
    for k, (attempt, fine) in enumerate(zip(found, task.results(jobs), strict=True)):
        iterations += fine.iterations if attempt.intervals != task.intervals else 0
        # Coarse durations may be spurious; those on the mesh are the ones to beat.
        candidates = distinct([*candidates, fine], task.policy.same.mesh, task.policy.same.distance)
        worth = task.policy.search.only_listed * candidates[0].cost if candidates else np.inf
        later = found[k + 1 :]
        if k + 1 == solves or task.stop or (later and later[0].cost >= worth):
            break
    candidates = candidates[:most] or list(found[:1])
    listed = tuple(attempt.trajectory.duration for attempt in found[k + 1 :])
    return SearchResult(tuple(candidates), mesh=task.intervals, listed=listed, iterations=iterations)


def _finer(attempt: Attempt, intervals: int, settings: SolverSettings, task: Task) -> Attempt:
    return attempt if attempt.intervals == intervals else solve_quickly(task, attempt.trajectory, intervals, settings)


def _too_coarse(task: Task, found: Sequence[Attempt], refined: SearchResult) -> tuple[int, tuple[int, int], int] | None:
    """Meshes for another search if the finer mesh contradicts the search; None: it does not.

    Returns:
        The mesh for arc detection, the search's meshes, and the number of guesses.
    """
    numbers, mesh = task.policy.search, task.intervals
    if task.problem.robot.nv == 1 or task.stop:
        return None
    slower = refined.attempts[0].cost / found[0].cost
    confirmed = slower > numbers.too_coarse_confirmed and all(
        _misses_goal(task, attempt) for attempt in refined.attempts
    )
    if not (confirmed or slower > numbers.too_coarse):
        return None
    task.progress(f"optima of {task.policy.search.meshes} intervals are {slower:.2f} times as slow on {mesh}")
    finer = doubled(mesh, task.options.max_intervals) if confirmed else None
    on = finer or mesh
    return on, (on, on * 3 // 2), 4 if finer else 2


def at_speed(task: Task, motion: Trajectory) -> bool:
    """Whether a motion reaches a velocity limit."""
    near = (1 - task.policy.arcs.near_speed) * task.problem.limits.velocity
    return bool(np.any(np.abs(motion.v) >= near))


def _misses_goal(task: Task, attempt: Attempt) -> bool:
    """Whether the replay of the mesh's torques ends at a different pose."""
    problem, motion, numbers = task.problem, attempt.trajectory, task.policy.search
    missed = np.abs(problem.goal_error_of(replay_of(task, motion))[: problem.robot.nv])
    return not np.max(missed) <= numbers.replay_miss * np.max(np.ptp(motion.q, axis=0))


def _without_search(task: Task, failed: list[Attempt]) -> list[Attempt]:
    """Attempts if no guess converged: the finer mesh, from the straight guess and the last iterate."""
    attempts, intervals = list(failed), task.intervals
    for guess in (spline(task.problem, []), failed[0].trajectory):
        if task.stop:
            break
        task.progress(f"no guess converged: trying {intervals} intervals")
        attempts.append(solve_on_mesh(task, guess, intervals, task.alone()))
        if attempts[-1].usable:
            break

    def rest(attempt: Attempt) -> float:
        if attempt.worst_violation is None:
            return 0.0 if attempt.usable else np.inf  # not begun: no information
        return attempt.worst_violation.value

    return sorted(attempts, key=lambda attempt: (not attempt.usable, rest(attempt)))
