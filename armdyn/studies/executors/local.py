"""Executors of this machine: this process, its threads, other processes."""

import queue
import time
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import replace

from armdyn.parallel import ForkPool, core_count, fork_pool
from armdyn.studies.executors.executor import HERE, Ended, Executor, StudyCase, run_in_turn
from armdyn.studies.tasks.task import StudyTask, storable

_QUEUED_PER_WORKER = 4
"""Cases per thread that are under way or wait."""


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
        self._task, self._pool = task, pool
        self._under_way, self._done = 0, queue.SimpleQueue[Future[Ended]]()

    def batch_size(self, left: int) -> int:
        """Number of cases to be given now: 1 while few cases wait."""
        return min(left, 1, _QUEUED_PER_WORKER * self.size - self._under_way)

    def give(self, cases: Sequence[StudyCase]) -> None:
        """Put cases into the pool's queue."""
        for case in cases:
            self._under_way += 1
            self._pool.submit(_done, self._task, case).add_done_callback(self._done.put)

    def ended(self, seconds: float) -> list[Ended]:
        """Wait for reports."""
        found = list[Ended]()
        while self._under_way and (not found or not self._done.empty()):
            try:
                found.append(self._done.get(timeout=seconds).result())
            except queue.Empty:
                break
            self._under_way -= 1
        return found


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
