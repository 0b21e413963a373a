"""Many solves from guesses, and the distinct optima among them.

Good optima lie near each other: those that random poses reach once in hundreds of guesses are reached by one crossover
of the best optima in ten. A child has a small bend added to all joints, a detour of one joint, or the motions of some
joints from another optimum. (Leary, Global optimization on funneling landscapes, 2000; of trajectories Vasile, Minisci
and Locatelli, 2011.)
"""

from bisect import insort
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import TypeVar

import numpy as np

from armdyn.optimal.mesh.condensed import guess_jobs, prepare_quickly
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.mesh.starts import SAMPLES, Guesses, splines, via_guesses
from armdyn.optimal.problem.options import SolverSettings
from armdyn.optimal.problem.policy.search import SearchPolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.task import Task

Item = TypeVar("Item")


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


Job = Callable[[Task], Attempt]
"""A solve as a function of the task; it is pickled."""


Settings = Sequence[tuple[int, SolverSettings]]
"""Number of intervals and solver settings of guesses, used in turn."""


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
        due = numbers.ends_early and task.options.search != "thorough" and own % numbers.batch == 0
        optima = len(grouped(solved, within(task.policy.same.coarse))) if due else 0
        if task.stop or (due and enough(len(solved), optima)):
            break
    return attempts


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


def crossover(
    problem: MinimumTimeProblem,
    parents: Guesses,
    random: np.random.Generator,
    number: int,
    policy: SearchPolicy,
) -> Guesses:
    """A child of one of some motions, most often of one of the first, slowed down a little.

    Args:
        problem: problem with the position limits that the child keeps.
        parents: motions, best first.
        random: random generator.
        number: index of the child: the kinds of change are used in turn.
        policy: sizes of the changes.
    """
    many = len(parents.t)
    chosen, other = random.exponential(policy.selection_scale, 2).astype(int) % many
    duration = parents.durations[chosen]
    q, v, tau = (part[chosen].copy() for part in (parents.q, parents.v, parents.tau))
    offset = np.zeros(q.shape[1])
    if number % 3 == 0:
        way = np.abs(np.asarray(problem.q_goal) - np.asarray(problem.q_start))
        offset = policy.midpoint_spread * random.normal(size=offset.size) * np.maximum(way, policy.least_spread)
    elif number % 3 == 1 and many > 1 and offset.size > 1:
        mate = other if other != chosen else (chosen + 1) % many
        taken = random.permutation(offset.size) < random.integers(1, offset.size)
        q[:, taken], tau[:, taken] = parents.q[mate][:, taken], parents.tau[mate][:, taken]
        v[:, taken] = parents.v[mate][:, taken] * parents.durations[mate] / duration
    else:
        offset[random.integers(offset.size)] = policy.joint_offset * random.uniform(-1, 1)
    s = np.linspace(0, 1, len(q))
    bump = 4 * s * (1 - s)
    q += (bump**3)[:, None] * offset
    v += (12 * bump**2 * (1 - 2 * s))[:, None] * offset / duration
    q[1:-1] = np.clip(q[1:-1], problem.limits.position_lower, problem.limits.position_upper)
    return Guesses(
        s[None] * (policy.mutation_duration * duration), q[None], v[None] / policy.mutation_duration, tau[None]
    )
