"""Run jobs in parallel: in forked processes, which end with the process that forked them, or in threads."""

import ctypes
import multiprocessing
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Callable, Collection, Generator, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import cache
from multiprocessing.connection import Connection, wait
from multiprocessing.context import ForkProcess
from typing import Any, Generic, TypeVar

from threadpoolctl import ThreadpoolController

from armdyn.locks import one_at_a_time

Result = TypeVar("Result")
Job = TypeVar("Job")
Context = TypeVar("Context")

_GRACE = 0.75
"""Grace period [s]: workers still running after it are interrupted again, and after a second one killed, so that
Ctrl-C takes two seconds at most."""
LISTEN = 0.25
"""Polling period of Ctrl-C [s] while workers work."""
_PR_SET_PDEATHSIG = 1

_own_ends: set[Connection] = set()
"""Our ends of all pipes to workers. A worker must not keep those of others, or these would miss that we ended."""


def in_processes(
    jobs: Sequence[Callable[[], Result]], workers: int | None, first_here: bool = False
) -> Generator[Result]:
    """Results of jobs in parallel processes, in the order of the jobs.

    Workers are forks, which inherit all objects built before; jobs are begun in order, results are pickled. Workers end
    with this process, however it ends, and with the thread that forked them. When the caller stops iterating,
    running jobs are killed. Jobs poll a `Stop` of this process, which forks share.

    Args:
        jobs: functions without arguments. A job whose worker dies or raises is done again here.
        workers: processes at most; None: one per core. With one, within a worker, or where there is no fork, all is
            done here.
        first_here: this process does the first job meanwhile: often it is the only one whose result is read.
    """
    with job_pool(jobs, workers) as pool:
        yield from _in_order(pool, range(len(jobs)), lambda k: jobs[k](), first_here)


def _in_order(
    pool: "ForkPool[Result]", jobs: Sequence[Job], here: Callable[[Job], Result], first_here: bool = False
) -> Generator[Result]:
    """Results of a pool in the order of the jobs; a job that no worker has done is done here."""
    waiting, known = deque(range(len(jobs))), dict[int, tuple[Result] | None]()
    if first_here and pool.count:
        first = waiting.popleft()
        while pool.idle > 1 and waiting:
            number = waiting.popleft()
            pool.submit(number, jobs[number])
        known[first] = (here(jobs[first]),)
    for k, job in enumerate(jobs):
        while pool.count and k not in known:
            while pool.idle and waiting:
                number = waiting.popleft()
                pool.submit(number, jobs[number])
            known.update((number, result) for number, _, result in pool.finished(None))
        found = known.pop(k, None)
        yield here(job) if found is None else found[0]


@contextmanager
def shared_pool(
    context: Context, workers: int | None, threads: bool = False
) -> Iterator[Callable[[Sequence[Callable[[Context], Any]]], Generator[Any]]]:
    """Pool for several series of jobs: forks take longer than small solves.

    Yields a function of a series of jobs, which yields their results in their order, as `in_processes` does. Jobs are
    functions of the context; to processes they are pickled.

    Args:
        context: object that the jobs are functions of. Processes have it as it was when the first jobs came.
        workers: see `in_processes`.
        threads: of this process instead of forks, for jobs that work where the interpreter's lock is let go. Those
            running when the caller stops iterating go on to their end.
    """

    def here(job: Callable[[Context], Any]) -> Any:
        return job(context)

    count = workers or core_count()
    if threads and count > 1 and not _is_worker():

        def in_threads(jobs: Sequence[Callable[[Context], Any]]) -> Generator[Any]:
            yield from executor.map(here, jobs)

        with ThreadPoolExecutor(count) as executor:
            yield in_threads
        return

    def in_forks(jobs: Sequence[Callable[[Context], Any]]) -> Generator[Any]:
        try:
            yield from _in_order(pool, jobs, here)
        finally:
            pool.drop()

    with fork_pool(here, count if _worth_forks(count, 2) else 0) as pool:
        yield in_forks


@contextmanager
def concurrently(
    job: Callable[[], Result], workers: int | None, stop: Callable[[], bool], otherwise: Result
) -> Iterator[Callable[[], Result]]:
    """Run a job in a process of its own; yields a function that waits for the result and returns it.

    Args:
        job: the function; if its worker dies or raises, or there is none, it runs here when the result is requested.
        workers: processes at most; with one there is no other.
        stop: condition that the job polls, too; once true, it is waited for no longer than the grace period.
        otherwise: result of a job that goes on beyond that.
    """
    known: list[Result] = []
    with job_pool([job] if workers != 1 else [], None, least=1) as pool:
        if pool.count:
            pool.submit(0, 0)

        def result() -> Result:
            while not known:
                stopped = stop()
                found = pool.finished(_GRACE) if pool.count else [(0, None, None)]
                if found:
                    known.append(job() if found[0][2] is None else found[0][2][0])
                elif stopped:
                    known.append(otherwise)
            return known[0]

        yield result


class ForkPool(Generic[Result]):
    """Pool of forked workers that apply one function; a worker that dies is replaced.

    Attributes:
        count: of them.
    """

    def __init__(self, do: Callable[[Any], Result], count: int):
        self.count = count
        self._do = do
        self._processes: dict[Connection, ForkProcess] = {}
        self._idle: list[Connection] = []
        self._under_way: dict[Connection, int] = {}

    @property
    def idle(self) -> int:
        """Number of idle workers."""
        return self.count - len(self._under_way)

    def submit(self, number: int, what: object) -> None:
        """Submit an argument to an idle worker.

        Args:
            number: of the job, which `finished` yields.
            what: the argument, which is pickled.
        """
        while True:
            line = self._idle.pop() if self._idle else _fork(self._do, self._processes)
            try:
                line.send(what)
            except OSError:  # it died while it was idle
                self._dismiss(line).join()
                continue
            self._under_way[line] = number
            return

    def finished(self, seconds: float | None) -> list[tuple[int, int | None, tuple[Result] | None]]:
        """Number, process and result of jobs that have ended; the result is None where the worker died.

        Args:
            seconds: longest wait [s]; None: until a job ends.
        """
        found: list[tuple[int, int | None, tuple[Result] | None]] = []
        ready = wait(list(self._under_way), seconds)
        for line in [line for line in self._under_way if line in ready]:
            number, process = self._under_way.pop(line), self._processes[line].pid
            try:
                found.append((number, process, (line.recv(),)))
                self._idle.append(line)
            except (OSError, EOFError):
                self._dismiss(line).join()
                found.append((number, process, None))
        return found

    def interrupt(self) -> None:
        """Interrupt the running jobs: those that poll a `Stop` return their results so far."""
        for line in self._under_way:
            if (number := self._processes[line].pid) is not None:
                with suppress(ProcessLookupError):
                    os.kill(number, signal.SIGINT)

    def drop(self) -> None:
        """Kill the busy workers; new ones replace them when jobs come."""
        for line in self._under_way:
            self._dismiss(line)
        self._under_way.clear()

    def close(self, patient: bool) -> None:
        """Kill all workers, without waiting for their end, which takes as long as a small solve.

        Args:
            patient: they are interrupted before, and have 1.5 s to end.
        """
        _own_ends.difference_update(self._processes)
        for line in self._processes:
            with suppress(OSError):  # else it has ended
                line.send(None)
            line.close()
        try:
            if patient:
                _interrupt(self._processes.values())
        finally:
            for worker in self._processes.values():
                worker.kill()

    def _dismiss(self, line: Connection) -> ForkProcess:
        """Close the pipe to a worker and kill it, without waiting for its end."""
        worker = self._processes.pop(line)
        _own_ends.discard(line)
        line.close()
        worker.kill()
        return worker


@contextmanager
def fork_pool(do: Callable[[Any], Result], count: int | None, patient: bool = False) -> Iterator[ForkPool[Result]]:
    """Pool of forked workers, killed on exit. They end with this process, too.

    Args:
        do: their function, which may use everything that this process has built; results are pickled. An exception
            kills the worker.
        count: of them; None: one per core.
        patient: see `ForkPool.close`.

    Raises:
        OSError: processes cannot be forked here.
    """
    if count != 0 and not _can_fork():
        raise OSError("processes cannot be forked on this system")
    workers = ForkPool(do, core_count() if count is None else count)
    try:
        yield workers
    finally:
        workers.close(patient)


def one_blas_thread() -> AbstractContextManager[object]:
    """Linear algebra on one thread within it, also in workers forked there.

    Systems are small: a second thread waits more than it works, takes a core from another worker, and adds up in
    another order, so that the last digits depend on the machine.
    """
    limited: AbstractContextManager[object] = _thread_pools().limit(limits=1, user_api="blas")
    return limited


@cache
def _thread_pools() -> ThreadpoolController:
    return ThreadpoolController()


def core_count() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def may_thread() -> bool:
    """Whether a second thread has a core: not in a worker, whose siblings use the others."""
    return core_count() > 1 and not _is_worker()


def _can_fork() -> bool:
    return "fork" in multiprocessing.get_all_start_methods()


def job_pool(
    jobs: Sequence[Callable[[], Result]], workers: int | None, patient: bool = False, least: int = 2
) -> AbstractContextManager[ForkPool[Result]]:
    """Pool that does jobs by their numbers; it has no worker where all is to be done in this process.

    Args:
        jobs: functions; workers inherit them, as they are forks.
        workers: at most; None: one per core.
        patient: see `ForkPool.close`.
        least: fewest workers that are worth their forks.
    """
    count = min(workers or core_count(), len(jobs))
    return fork_pool(lambda k: jobs[k](), count if _worth_forks(count, least) else 0, patient)


def _worth_forks(count: int, least: int) -> bool:
    return count >= least and _can_fork() and not _is_worker()


def _is_worker() -> bool:
    return multiprocessing.current_process().daemon


def _fork(do: Callable[[Any], object], processes: dict[Connection, ForkProcess]) -> Connection:
    context = multiprocessing.get_context("fork")
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})  # until the child ignores it
    try:
        with one_at_a_time:  # or another thread's worker might keep the other end
            ours, theirs = context.Pipe()
            _own_ends.add(ours)
            worker = context.Process(target=_work, args=(do, theirs, os.getpid()), daemon=True)
            worker.start()
            theirs.close()
        processes[ours] = worker
        return ours
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _interrupt(workers: Collection[ForkProcess]) -> None:
    """Interrupt workers and wait for them; those that still run after the grace period are interrupted once more."""
    for _ in range(2):
        for worker in [worker for worker in workers if worker.is_alive()]:
            os.kill(worker.ident or os.getpid(), signal.SIGINT)
        until = time.monotonic() + _GRACE
        for worker in workers:
            worker.join(max(0.0, until - time.monotonic()))


def _work(do: Callable[[Any], object], line: Connection, owner: int) -> None:
    try:
        _end_with(owner)
        signal.set_wakeup_fd(-1)  # an event loop's, of the owner
        if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:  # by inheritance: it stays so
            signal.signal(signal.SIGINT, lambda number, frame: None)  # a `Stop` raises it, or a job that handles it
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
        for other in _own_ends:
            other.close()
        while (what := line.recv()) is not None:
            line.send(do(what))
    finally:  # the pipe closes: the waiting process does the job itself
        os._exit(1)


def _end_with(owner: int) -> None:
    """Have the kernel kill this process when its owner ends, even within a long call outside Python.

    Strictly, when the owner's thread ends that forked: lost jobs are done again there. Where the kernel cannot, a
    worker ends after its job, when it finds the pipe closed.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, ctypes.c_ulong(signal.SIGKILL))
    if os.getppid() != owner:  # it ended before
        os._exit(1)
