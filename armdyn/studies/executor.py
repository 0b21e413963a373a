"""Executors, which run the cases of a study: their protocol, and this process, its threads and its children."""

import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from typing import Protocol

from armdyn.parallel import ForkPool, core_count, fork_pool
from armdyn.studies.rows import Value
from armdyn.studies.tasks.task import CaseResult, StudyTask, result_of, storable

_QUEUED_PER_WORKER = 4
"""Cases per thread that are under way or wait."""
HERE = "this process"
"""Name of the worker that is the engine's own process: when its case is interrupted, the study ends."""


@dataclass(frozen=True, kw_only=True)
class StudyCase:
    """A case of a study as a worker gets it.

    Attributes:
        k: its number.
        settings: of the case.
        guess: motion of a neighbour; empty: none.
        begun_from: number of that neighbour; None: none.
        near: numbers of its neighbours, the nearest first: the motion of one that the same worker has just done is
            preferred to a farther guess.
        revisit: the case has a row already.
    """

    k: int
    settings: Mapping[str, Value]
    guess: bytes = b""
    begun_from: int | None = None
    near: tuple[int, ...] = ()
    revisit: bool = False


@dataclass(frozen=True, kw_only=True)
class Ended:
    """Report of a worker on a case.

    Attributes:
        k: number of the case.
        result: None: the worker died.
        seconds: work on it [s].
        worker: name of the worker.
        deaths: number of workers that died of the case, and that the executor has replaced itself.
        begun_from: number of the case whose motion was the guess; None: none.
    """

    k: int
    result: CaseResult | None
    seconds: float = 0.0
    worker: str = ""
    deaths: int = 0
    begun_from: int | None = None


class Executor(Protocol):
    """Workers of a study, which are sent cases and report results."""

    @property
    def size(self) -> int:
        """Number of cases that run concurrently."""

    def batch_size(self, left: int) -> int:
        """Number of cases to send to a worker now; 0 if all workers are busy.

        Args:
            left: number of cases that wait.
        """

    def give(self, cases: Sequence[StudyCase]) -> None:
        """Submit cases to one worker, which runs them in sequence."""

    def ended(self, seconds: float) -> list[Ended]:
        """Wait for reports, at most this time [s]."""


ExecutorOf = Callable[[StudyTask], AbstractContextManager[Executor]]
"""Opens an executor for a task."""


def run_in_turn(task: StudyTask, cases: Sequence[StudyCase], time_limit: float) -> Iterator[Ended]:
    """Do cases one after the other, each from the nearest available motion.

    Args:
        task: the work on each.
        cases: at least one; the first is done in any case.
        time_limit: time [s] after which no case is begun; the caller submits the remaining ones again.
    """
    began, motions = time.perf_counter(), dict[int, bytes]()
    for case in cases:
        begun_from, guess = _nearest(case, motions)
        result, seconds = result_of(task, case.settings, guess, case.revisit)
        if result.motion:
            motions[case.k] = result.motion
        yield Ended(k=case.k, result=result, seconds=seconds, begun_from=begun_from)
        if time.perf_counter() - began > time_limit:
            return


def _nearest(case: StudyCase, motions: Mapping[int, bytes]) -> tuple[int | None, bytes]:
    """Number and motion of the nearest case, among those solved by this worker and the submitted guess."""
    for k in case.near:
        if k == case.begun_from:
            break
        if k in motions:
            return k, motions[k]
    return case.begun_from, case.guess


class LocalProcesses:
    """Processes of this machine, each with one case at a time."""

    def __init__(self, workers: ForkPool[Ended]):
        self._workers = workers
        self._begun_from: dict[int, int | None] = {}

    @property
    def size(self) -> int:
        """Number of processes."""
        return self._workers.count

    def batch_size(self, left: int) -> int:
        """Number of cases to be given now: 1 while a process is idle."""
        return min(self._workers.idle, left, 1)

    def give(self, cases: Sequence[StudyCase]) -> None:
        """Send cases to an idle process."""
        for case in cases:
            self._begun_from[case.k] = case.begun_from
            self._workers.submit(case.k, case)

    def ended(self, seconds: float) -> list[Ended]:
        """Wait for reports."""
        found = list[Ended]()
        for k, process, result in self._workers.finished(seconds):
            begun_from = self._begun_from.pop(k)
            one = result[0] if result else Ended(k=k, result=None, begun_from=begun_from)
            found.append(replace(one, worker=f"process {process}"))
        return found


@contextmanager
def local_executor(task: StudyTask, workers: int | None = None) -> Iterator[Executor]:
    """Fork processes for a study; they end with this process, however it ends.

    Args:
        task: the work on each case.
        workers: number of processes; None: one per core.
    """

    def do(case: StudyCase) -> Ended:
        return next(run_in_turn(task, [case], 0.0))

    with fork_pool(do, workers) as forks:
        yield LocalProcesses(forks)


class InProcess:
    """This process, with one case at a time: work that handles Ctrl-C receives it. Exceptions are raised."""

    size = 1

    def __init__(self, task: StudyTask):
        self._task, self._waiting = task, deque[StudyCase]()

    def batch_size(self, left: int) -> int:
        """Number of cases to be given now: 1 unless a case is waiting."""
        return min(left, 1 - len(self._waiting))

    def give(self, cases: Sequence[StudyCase]) -> None:
        """Queue cases, which `ended` runs."""
        self._waiting.extend(cases)

    def ended(self, seconds: float) -> list[Ended]:
        """Do one case."""
        return [_done(self._task, self._waiting.popleft())] if self._waiting else []


class Threads:
    """Threads of this process, for work that runs in C without the interpreter's lock. Exceptions are raised."""

    def __init__(self, task: StudyTask, size: int, pool: ThreadPoolExecutor):
        self.size = size
        self._task, self._pool, self._under_way = task, pool, set[Future[Ended]]()

    def batch_size(self, left: int) -> int:
        """Number of cases to be given now: 1 while few cases wait."""
        return min(left, 1, _QUEUED_PER_WORKER * self.size - len(self._under_way))

    def give(self, cases: Sequence[StudyCase]) -> None:
        """Put cases into the pool's queue."""
        self._under_way |= {self._pool.submit(_done, self._task, case) for case in cases}

    def ended(self, seconds: float) -> list[Ended]:
        """Wait for reports."""
        done, self._under_way = wait(self._under_way, seconds, FIRST_COMPLETED)
        return [future.result() for future in done]


@contextmanager
def in_process(task: StudyTask, workers: int | None = 1) -> Iterator[Executor]:
    """Do a study's cases in this process.

    Args:
        task: the work on each.
        workers: threads; with one the calling thread does the work; None: one per core.
    """
    size = workers or core_count()
    if size == 1:
        yield InProcess(task)
        return
    pool = ThreadPoolExecutor(size)
    try:
        yield Threads(task, size, pool)
    finally:
        pool.shutdown(cancel_futures=True)


def _done(task: StudyTask, case: StudyCase) -> Ended:
    began = time.perf_counter()
    result = storable(task.work(case.settings, case.guess, case.revisit))
    seconds = time.perf_counter() - began
    return Ended(k=case.k, result=result, seconds=seconds, worker=HERE, begun_from=case.begun_from)
