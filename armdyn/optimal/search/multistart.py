"""Global search: many guesses solved coarsely, on all cores; the different optima that they lead to."""

from collections.abc import Callable, Sequence
from functools import partial

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.search.starts import detours, spline
from armdyn.optimal.solve.attempt import Attempt
from armdyn.optimal.solve.condensed import prepare_quickly, solve_quickly
from armdyn.optimal.task.options import DirectOptions, MinimumTimeOptions
from armdyn.optimal.task.policy import Policy
from armdyn.optimal.task.scheme import Scheme
from armdyn.optimal.task.task import Task
from armdyn.processes import in_processes

SAME = 2e-3
"""Coarse durations that differ by less than this part are taken for one optimum."""


def search(
    problem: MinimumTimeProblem,
    dynamics: Dynamics,
    scheme: Scheme,
    meshes: Sequence[int],
    count: int,
    seed: int,
    options: Sequence[DirectOptions],
    workers: int | None,
    stop: Stop,
    progress: Callable[[str], None],
    beside: Sequence[Callable[[], Attempt]] = (),
) -> list[Attempt]:
    """Attempts from guesses, in the order of the guesses; the first is the straight one.

    There are `count` guesses, fewer where a dozen or so have led to few optima again and again.

    Guesses take turns on the meshes and, at half that pace, on the options: what one hides another may show.

    The same seed gives the same attempts, on however many cores. Those `beside` come first, and are begun first.
    """
    task = Task(problem, dynamics, scheme, MinimumTimeOptions(), Policy.of(problem), stop)
    ways = detours(problem, seed, count)
    for intervals in meshes:  # before the fork, so that every worker has them
        for option in options:
            prepare_quickly(task, intervals, option)

    def job(k: int) -> Attempt:
        mesh, option = meshes[k % len(meshes)], options[k // len(meshes) % len(options)]
        return solve_quickly(task, spline(problem, ways[k]), mesh, option, between=False)

    done: list[Attempt] = []
    attempts: list[Attempt] = []
    jobs: list[Callable[[], Attempt]] = [*beside, *(partial(job, k) for k in range(count))]
    for attempt in in_processes(jobs, workers):
        if len(done) < len(beside):
            done.append(attempt)
            continue
        attempts.append(attempt)
        solved = [a.trajectory.duration for a in attempts if a.status is Status.SOLVED]
        best = f", best {min(solved):.4f} s" if solved else ""
        progress(f"search: guess {len(attempts)} of {count}{best}")
        # An optimum has another duration on another mesh, and counts on each: safer than to match them.
        if stop or _enough(len(solved), len(distinct(ranked(attempts)))):
            break
    return [*done, *attempts]


def _enough(solved: int, optima: int) -> bool:
    """Whether so many guesses have probably met all optima.

    The expected number of optima is optima (solved - 1) / (solved - optima - 2), whatever their basins'
    sizes (Boender and Rinnooy Kan, Bayesian stopping rules for multistart, 1987): stop where it is
    nearer to those seen than to one more.
    """
    return solved > optima + 2 and optima * (solved - 1) <= (optima + 0.5) * (solved - optima - 2)


def ranked(attempts: Sequence[Attempt]) -> list[Attempt]:
    """Converged ones by duration, then the rest."""
    return sorted(attempts, key=lambda a: (a.status is not Status.SOLVED, a.trajectory.duration))


def distinct(attempts: Sequence[Attempt], same: float = SAME) -> list[Attempt]:
    """Converged attempts of which no two have about the same duration, best first; of those the finest mesh's."""
    groups: list[list[Attempt]] = []
    for attempt in attempts:
        if attempt.status is not Status.SOLVED:
            continue
        if groups and attempt.trajectory.duration <= groups[-1][0].trajectory.duration * (1 + same):
            groups[-1].append(attempt)
        else:
            groups.append([attempt])
    return [max(group, key=lambda attempt: attempt.intervals) for group in groups]
