"""The optima that are worth refining: found on coarse meshes, told apart on a finer one."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np

from armdyn.optimal.landing.rollout import replay_of
from armdyn.optimal.program.unknowns import doubled
from armdyn.optimal.search.crossover import crossover_guesses
from armdyn.optimal.search.distinct import distinct, ranked
from armdyn.optimal.search.multistart import Job, SearchSettings, search
from armdyn.optimal.search.starts import spline
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.solve.condensed import has_stagewise, prepare_quickly, solve_quickly
from armdyn.optimal.solve.direct import solve_on_mesh
from armdyn.optimal.task.solver_settings import SolverSettings
from armdyn.optimal.task.tableau import DynamicsForm
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Found:
    """Result of a search.

    Attributes:
        attempts: the best optima, best first; none: the search found no motion.
        failed: if there are none, what was tried, the least bad first.
        mesh: intervals of the one that arcs are to be read from first.
        listed: durations of the others on coarse meshes [s].
        slower: durations of those that were told apart better, and were not worth more [s].
        iterations: of IPOPT.
        remark: a sentence for a motion that is not certified: how many different optima the guesses have met, or that
            refinement was given up; else empty.
    """

    attempts: tuple[Attempt, ...]
    failed: tuple[Attempt, ...] = ()
    mesh: int = 0
    listed: tuple[float, ...] = ()
    slower: tuple[float, ...] = ()
    iterations: int = 0
    remark: str = ""


@dataclass(frozen=True, eq=False)
class _RefinedSearch:
    """The best coarse optima on a finer mesh, in the order that it puts them in; durations of the others."""

    attempts: list[Attempt]
    listed: list[float]
    iterations: int


def find(task: Task) -> Found:
    """Search from many guesses on coarse meshes, and solve the best on the mesh that arcs are read from.

    Args:
        task: what is to be solved.
    """
    options, numbers = task.options, task.policy.search
    same = task.policy.same.coarse, task.policy.same.apart
    count = numbers.guesses(options)
    extra_jobs = _extra_jobs(task)
    task.progress(
        f"search: {count} guesses" + (f", and {len(extra_jobs)} on {options.intervals} intervals" if extra_jobs else "")
    )
    prepare_quickly(task, options.intervals, task.fine())  # before the fork, too
    with task.pooled(has_stagewise(task)) as pooled:
        attempts = _searched(pooled, count, SearchSettings(task.meshes, task.coarse()), extra_jobs)
        fine, coarse = (distinct(some, *same) for some in (attempts[: len(extra_jobs)], attempts[len(extra_jobs) :]))
        found = ranked([*fine, *coarse])  # what is on the finer mesh already hides none of the others: it costs no more
        if not found:
            attempts = _without_search(task, ranked(attempts))
            found = distinct(attempts, *same)
        iterations = sum(attempt.iterations for attempt in attempts)
        if not found:
            return Found((), failed=tuple(attempts), iterations=iterations)
        refined, mesh = _refined(pooled, found), options.intervals
    iterations += refined.iterations
    if finer := _too_coarse(task, found, refined):
        mesh, meshes, share = finer
        # Those that meshes err on are heavy: their optima are near the way.
        near = replace(task, policy=task.policy.changed("search", spread=1.0, turn=0.0))
        several = min(count, max(count // share, numbers.again_at_least))
        prepare_quickly(task, mesh, task.fine())
        with near.with_options(intervals=mesh).pooled(has_stagewise(near)) as near:
            again = _searched(near, several, SearchSettings(meshes, task.coarse()), known=refined.attempts)
            found = distinct([*refined.attempts, *again], *same)
            refined = _refined(near, found)
        iterations += refined.iterations + sum(attempt.iterations for attempt in again)
    return Found(tuple(refined.attempts), mesh=mesh, listed=tuple(refined.listed), iterations=iterations)


def _searched(
    task: Task,
    count: int,
    search_settings: SearchSettings,
    extra_jobs: Sequence[Job] = (),
    known: Sequence[Attempt] = (),
) -> list[Attempt]:
    """Attempts from guesses through random poses, and from changes of their optima and of known ones.

    Many guesses are several lineages, each of as many as a search has by default: one alone forgets what is not among
    its best.
    """
    changes = round(task.policy.search.changes * count)
    attempts = search(task, count - changes, search_settings, extra_jobs)
    if not changes or len(attempts) < len(extra_jobs) + count - changes:  # enough, or no more time
        return attempts
    nearby = replace(
        search_settings, settings=search_settings.settings[:1]
    )  # the smallest barrier keeps most of a guess
    lineages = max(1, round(count / task.policy.search.starts))
    ends = [changes * k // lineages for k in range(lineages + 1)]
    for k, (first, end) in enumerate(pairwise(ends)):
        ancestors = [*known, *attempts[len(extra_jobs) : len(extra_jobs) + count - changes][k::lineages]]
        attempts = [*attempts, *crossover_guesses(task, ancestors, end - first, nearby, first)]
    return attempts


def _extra_jobs(task: Task) -> list[Job]:
    """Guesses that are solved on the fine mesh at once: those of the options."""
    intervals, settings = task.options.intervals, task.fine()
    jobs: list[Job] = []
    for guess in task.options.guesses:
        prepare_quickly(task, intervals, settings)
        jobs.append(partial(_on_mesh, guess, intervals, settings))
    return jobs


def _on_mesh(guess: Trajectory, intervals: int, settings: SolverSettings, task: Task) -> Attempt:
    return solve_quickly(task, guess, intervals, settings)


def _refined(task: Task, found: Sequence[Attempt]) -> _RefinedSearch:
    """The best coarse optima, each once, on the mesh that arcs are read from first.

    Args:
        task: whose `options.intervals` is that mesh.
        found: optima, best first.
    """
    options, settings = task.options, task.fine()
    most = task.policy.search.refinements(options)
    prepare_quickly(task, options.intervals, settings)

    task.progress(f"the best optima, about {found[0].trajectory.duration:.4f} s, on {options.intervals} intervals")
    candidates: list[Attempt] = []
    iterations, looked = 0, most * task.policy.search.looked_at
    jobs = [partial(_finer, attempt, options.intervals, settings) for attempt in found]
    for k, (attempt, fine) in enumerate(zip(found, task.results(jobs), strict=True)):
        iterations += fine.iterations if attempt.intervals != options.intervals else 0
        # Coarse durations may be far too good to be true; those on the mesh are to be beaten.
        candidates = distinct([*candidates, fine], task.policy.same.mesh, task.policy.same.apart)
        worth = task.policy.search.worth * candidates[0].trajectory.duration if candidates else np.inf
        later = found[k + 1 :]
        if k + 1 == looked or task.stop or (later and later[0].trajectory.duration >= worth):
            break
    candidates = candidates[:most] or list(found[:1])
    return _RefinedSearch(candidates, [attempt.trajectory.duration for attempt in found[k + 1 :]], iterations)


def _finer(attempt: Attempt, intervals: int, settings: SolverSettings, task: Task) -> Attempt:
    return attempt if attempt.intervals == intervals else _on_mesh(attempt.trajectory, intervals, settings, task)


def _too_coarse(
    task: Task, found: Sequence[Attempt], refined: _RefinedSearch
) -> tuple[int, tuple[int, int], int] | None:
    """Where to search again if the finer mesh contradicts the search; None: it does not.

    Returns:
        The mesh to settle on, those to search on, and for how many guesses there is one then.
    """
    numbers, mesh = task.policy.search, task.options.intervals
    if not numbers.again or task.stop:
        return None
    slower = refined.attempts[0].trajectory.duration / found[0].trajectory.duration
    astray = slower > numbers.doubted and all(_astray(task, attempt) for attempt in refined.attempts)
    if not (astray or slower > numbers.too_coarse):
        return None
    task.progress(f"optima of {task.meshes} intervals are {slower:.2f} times as slow on {mesh}")
    finer = doubled(mesh, task.options.max_intervals) if astray else None
    on = finer or mesh
    return on, (on, on * 3 // 2), 4 if finer else 2


def _astray(task: Task, attempt: Attempt) -> bool:
    """Whether the arm ends somewhere else when the mesh's torques are replayed."""
    problem, motion = task.problem, attempt.trajectory
    missed = np.abs(problem.goal_error_of(replay_of(task, motion))[: problem.robot.nv])
    return not np.max(missed) <= task.policy.search.astray * np.max(np.ptp(motion.q, axis=0))


def _without_search(task: Task, failed: list[Attempt]) -> list[Attempt]:
    """When no guess converged: a finer mesh, the other form of the dynamics, and the other guesses' remains."""
    other: DynamicsForm = "inverse" if task.scheme.dynamics == "forward" else "forward"
    straight, remains = spline(task.problem, []), failed[0].trajectory
    attempts, intervals = list(failed), task.options.intervals
    for form, guess in ((task.scheme.dynamics, straight), (other, straight), (task.scheme.dynamics, remains)):
        if task.stop:
            break
        task.progress(f"no guess converged: trying {form} dynamics on {intervals} intervals")
        step = replace(task, scheme=replace(task.scheme, dynamics=form))
        attempts.append(solve_on_mesh(step, guess, intervals, task.alone()))
        if attempts[-1].usable:
            break

    def rest(attempt: Attempt) -> float:
        if attempt.worst_violation is None:
            return 0.0 if attempt.usable else np.inf  # what was not begun says nothing
        return attempt.worst_violation.value

    return sorted(attempts, key=lambda attempt: (not attempt.usable, rest(attempt)))
