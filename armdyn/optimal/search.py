"""Global search: many guesses solved coarsely, on all cores; the different optima that they lead to."""

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.course import path_rows
from armdyn.optimal.direct import Attempt, DirectOptions, prepare, solve_on_mesh
from armdyn.optimal.monitor import Stop
from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.optimal.starts import detours, spline
from armdyn.optimal.status import Status
from armdyn.optimal.transcription import Scheme

SAME = 2e-3
"""Coarse durations that differ by less than this part are taken for one optimum."""

_Job = Callable[[int], Attempt]
_job: _Job | None = None
"""What a forked worker does: inherited, as compiled solvers cannot be sent."""


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
) -> list[Attempt]:
    """Attempts from guesses, in the order of the guesses; the first is the straight one.

    There are `count` guesses, fewer where a dozen or so have led to few optima again and again.

    Guesses take turns on the meshes and, at half that pace, on the options: what one hides another may show.

    The same seed gives the same attempts, on however many cores.
    """
    ways = detours(problem, seed, count)
    rows = path_rows(problem)
    for intervals in meshes:  # before the fork, so that every worker has them
        for option in options:
            prepare(dynamics, scheme, intervals, option, rows)

    def job(k: int) -> Attempt:
        mesh, option = meshes[k % len(meshes)], options[k // len(meshes) % len(options)]
        return solve_on_mesh(problem, spline(problem, ways[k]), dynamics, scheme, mesh, option, stop)

    attempts: list[Attempt] = []
    for attempt in _each(job, count, workers, stop):
        attempts.append(attempt)
        solved = [a.trajectory.duration for a in attempts if a.status is Status.SOLVED]
        best = f", best {min(solved):.4f} s" if solved else ""
        progress(f"search: guess {len(attempts)} of {count}{best}")
        # An optimum has another duration on another mesh, and counts on each: safer than to match them.
        if _enough(len(solved), len(distinct(ranked(attempts)))):
            break
    return attempts


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


def _each(job: _Job, count: int, workers: int | None, stop: Stop) -> Iterator[Attempt]:
    """Results in order; in processes where that is possible, as IPOPT does not stand threads."""
    global _job
    workers = min(workers or os.cpu_count() or 1, count)
    forks = "fork" in multiprocessing.get_all_start_methods() and not multiprocessing.current_process().daemon
    done = 0
    if workers > 1 and forks:
        _job = job
        try:
            with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("fork")) as pool:
                try:
                    for future in [pool.submit(_work, k) for k in range(count)]:
                        yield future.result()
                        done += 1
                        if stop:  # workers hear of Ctrl-C only from a terminal
                            return
                finally:  # also where the caller has seen enough
                    pool.shutdown(wait=True, cancel_futures=True)
        except BrokenProcessPool:
            pass  # a worker died: what it did not do is done here
        finally:
            _job = None
    for k in range(done, count):
        yield job(k)
        if stop:
            return


def _work(k: int) -> Attempt:
    if _job is None:
        raise RuntimeError("a worker without its job")
    return _job(k)
