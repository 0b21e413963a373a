"""The search: optima from many guesses on coarse meshes, and the best of them told apart on a finer one.

Good optima lie near each other: those that random poses reach once in hundreds of guesses are reached by one crossover
of the best optima in ten (`starts.crossover`).
"""

from bisect import bisect_right, insort
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TypeVar

import numpy as np

from armdyn.optimal.mesh.condensed import guess_jobs, has_stagewise, prepare_quickly, solve_quickly
from armdyn.optimal.mesh.direct import Attempt, solve_on_mesh
from armdyn.optimal.mesh.starts import SAMPLES, Guesses, crossover, spline, splines, via_guesses
from armdyn.optimal.problem.options import SolverSettings
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.rollout import replay_of
from armdyn.trajectory import Trajectory

Item = TypeVar("Item")
Job = Callable[[Task], Attempt]
"""A solve as a function of the task; it is pickled."""
Settings = Sequence[tuple[int, SolverSettings]]
"""Number of intervals and solver settings of guesses, used in turn."""


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
    if task.policy.program.condensed:  # where effort costs, too: the stagewise method takes a tenth of IPOPT's time
        task = replace(task, scheme=replace(task.scheme, control="constant"))
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
        attempts = _searched(pooled, count, numbers.meshes, extra_jobs)
        costs = sorted(one.cost for one in attempts if one.usable)
        whole = task.stop or options.starts or options.search == "thorough"
        if not whole and agreeing(costs, numbers.near_best) < numbers.scattered:
            other = replace(pooled, options=replace(options, seed=options.seed + 1))
            attempts += _searched(other, count, numbers.meshes, known=attempts)
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
        The mesh for arc detection, the search's meshes, and what part of the guesses suffices at speed: one in so many.
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
    finer = confirmed and 2 * mesh <= task.options.max_intervals
    on = 2 * mesh if finer else mesh
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


def grouped(items: Iterable[Item], alike: Callable[[Item, Item], bool]) -> list[list[Item]]:
    """Group items: each joins the first group whose first member is alike, or starts a group.

    Args:
        items: best first.
        alike: whether a later item equals a group's first.
    """
    groups: list[list[Item]] = []
    for item in items:
        group = next((group for group in groups if alike(group[0], item)), None)
        if group is None:
            groups.append([item])
        else:
            group.append(item)
    return groups


def within(same: float) -> Callable[[float, float], bool]:
    """Predicate: a number exceeds a smaller one by at most a part of the smaller one."""
    return lambda first, item: item <= first * (1 + same)


def ranked(attempts: Sequence[Attempt]) -> list[Attempt]:
    """Usable attempts by cost, then the rest."""
    return sorted(attempts, key=lambda a: (not a.usable, a.cost))


def distinct(attempts: Sequence[Attempt], same: float, apart: float = np.inf) -> list[Attempt]:
    """Usable attempts, best first, one per optimum: the one on the finest mesh.

    Args:
        attempts: in any order.
        same: largest relative difference of costs within one optimum.
        apart: largest distance of motions within one optimum, at the same part of their durations [rad or m].
    """
    groups, first = list[list[Attempt]](), 0
    for attempt in ranked(attempts):
        if not attempt.usable:
            break
        while first < len(groups) and attempt.cost > groups[first][0].cost * (1 + same):
            first += 1  # later attempts cost more still
        own = next((group for group in groups[first:] if _near(group[0], attempt, apart)), None)
        if own is None:
            groups.append([attempt])
        else:
            own.append(attempt)
    return [max(group, key=lambda attempt: attempt.intervals) for group in groups]


def _near(one: Attempt, other: Attempt, apart: float) -> bool:
    return apart == np.inf or float(np.abs(one.quarters - other.quarters).max()) <= apart


def search(task: Task, count: int, settings: Settings, extra_jobs: Sequence[Job] = ()) -> list[Attempt]:
    """Attempts from guesses, in the order of the guesses; the first guess is the straight path.

    The same seed gives the same attempts on any number of cores.

    Args:
        task: the problem and its settings.
        count: number of guesses; fewer are solved if few optima recur.
        settings: meshes and solver settings, used in turn.
        extra_jobs: other solves, which come first.
    """
    numbers = task.policy.search
    vias = via_guesses(task.problem, task.options.seed, count, (numbers.spread, numbers.uniform_spread), numbers)
    for each in settings:  # before the fork, so that every worker has them
        prepare_quickly(task, *each)

    attempts, solved = list[Attempt](), list[float]()
    guesses = splines(task.problem, vias, numbers.guess_duration)
    jobs = [*extra_jobs, *guess_jobs(task, guesses, [settings[k % len(settings)] for k in range(count)])]
    for attempt in in_batches(jobs[:1] if task.stop else jobs, task):
        attempts.append(attempt)
        own = len(attempts) - len(extra_jobs)
        if own <= 0:
            continue
        if attempt.usable:
            insort(solved, attempt.cost)
        best = f", best {solved[0]:.4f} s" if solved else ""
        task.progress(f"search: guess {own} of {count}{best}")
        # An optimum's cost depends on the mesh: it counts once per mesh, which is conservative.
        due = task.options.search != "thorough" and own % numbers.batch == 0
        if task.stop or (due and _known(task, solved, own)):
            break
    return attempts


def _known(task: Task, solved: Sequence[float], count: int) -> bool:
    """Whether guesses have probably found all optima, or nearly all of many lead to the best.

    Args:
        task: the problem and its settings.
        solved: costs of those that converged, least first.
        count: number of guesses.
    """
    numbers = task.policy.search
    if numbers.ends_early:
        return enough(len(solved), len(grouped(solved, within(task.policy.same.coarse))))
    return count >= numbers.tested and agreeing(solved, numbers.near_best) >= numbers.alike


def agreeing(costs: Sequence[float], slower: float) -> float:
    """Share of costs, least first, that exceed the least by at most a part `slower` of it; 1 of none."""
    return bisect_right(costs, costs[0] * (1 + slower)) / len(costs) if costs else 1.0


def in_batches(jobs: Sequence[Job], task: Task) -> Iterator[Attempt]:
    """The jobs' attempts in their order: several at once per worker, as one costs hardly more than its transfer."""
    size = 1 if task.workers == 1 else task.policy.search.batch
    batches = [jobs[k : k + size] for k in range(0, len(jobs), size)]
    for attempts in task.results([partial(_done, batch) for batch in batches]):
        yield from attempts


def _done(jobs: Sequence[Job], task: Task) -> list[Attempt]:
    attempts = [job(task) for job in jobs]
    for attempt in attempts:
        _ = attempt.quarters  # computed by the worker, for `distinct`
    return attempts


def enough(solved: int, optima: int) -> bool:
    """Whether the guesses so far have probably found all optima.

    The expected number of optima is optima (solved - 1) / (solved - optima - 2), whatever their basins'
    sizes (Boender and Rinnooy Kan, Bayesian stopping rules for multistart, 1987): stop where this number is
    nearer to the number seen than to one more.

    All sizes of basins are assumed equally likely. A basin of a share p is missed by n guesses with probability (1 -
    p)ⁿ, however often they have found the others.

    Args:
        solved: number of guesses that converged.
        optima: number of distinct optima.
    """
    return solved > optima + 2 and optima * (solved - 1) <= (optima + 0.5) * (solved - optima - 2)


def crossover_guesses(
    task: Task, attempts: Sequence[Attempt], count: int, settings: Settings, first: int = 0
) -> list[Attempt]:
    """Attempts from children of the best optima, round by round, from the best so far.

    The same attempts and seed give the same result on any number of cores.

    Args:
        task: the problem and its settings.
        attempts: attempts of the search so far.
        count: number of children.
        settings: meshes and solver settings, used in turn.
        first: index of the first child, which varies the random numbers.
    """
    numbers, same, children = task.policy.search, task.policy.same, list[Attempt]()
    while len(children) < count and not task.stop:
        best = distinct([*attempts, *children], same.coarse, same.distance)[: round(2 * numbers.selection_scale)]
        if not best:
            break
        parents = Guesses.sampled([attempt.trajectory for attempt in best], SAMPLES)
        about = best[0].trajectory.duration
        task.progress(f"search: child {len(children)} of {count} of the best optima, about {about:.4f} s")

        several = range(first + len(children), first + min(count, len(children) + 8 * numbers.batch))
        seeded = [(np.random.default_rng([task.options.seed, k]), k) for k in several]
        guesses = Guesses.joined([crossover(task.problem, parents, random, k, numbers) for random, k in seeded])
        children += in_batches(guess_jobs(task, guesses, [settings[k % len(settings)] for k in several]), task)
    return children
