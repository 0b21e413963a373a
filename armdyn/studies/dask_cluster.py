"""Executor on the workers of a running Dask cluster."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from importlib.metadata import version
from typing import TYPE_CHECKING

from armdyn.arguments import text
from armdyn.errors import ClusterError, MissingPackageError, ProblemError
from armdyn.studies.executor import Ended, Executor, ExecutorOf, StudyCase, run_in_turn
from armdyn.studies.tasks.task import INTERRUPTED, CaseResult, StudyTask

if TYPE_CHECKING:
    from distributed import Client, Future


TARGET = 1.0
"""Intended duration of a batch [s]: a hundred times the overhead of Dask and its client per task."""
_PER_SECOND = 100
"""Batches that one client and scheduler are given at most: where client, scheduler and workers shared two cores, a task
took 8 to 12 ms of the clock."""
MOST = 1000
"""Largest batch [cases]: as many are lost at most when a worker or the client dies."""
_NEW = 0.3
"""Weight of the last batch in the mean."""
_PARTS = 2
"""Batches for each worker that the cases left are at least, so that all have something to do at the end."""


def target(workers: int) -> float:
    """Intended duration of a batch for a number of workers [s]."""
    return max(TARGET, workers / _PER_SECOND)


class BatchSize:
    """Batch size from the durations of cases; it begins with one, and at most doubles from batch to batch."""

    def __init__(self) -> None:
        self._mean, self._most = 0.0, 1

    def add(self, cases: int, seconds: float) -> None:
        """Record a batch's duration [s], for the size of the next ones."""
        mean = seconds / cases
        self._mean = (1 - _NEW) * self._mean + _NEW * mean if self._mean else mean
        self._most = max(self._most, min(2 * cases, MOST))

    def cases(self, left: int, workers: int) -> int:
        """Number of cases of the next batch.

        Args:
            left: cases that wait.
            workers: among whom they are shared out.
        """
        number = target(workers)
        in_time = math.floor(number / self._mean) if self._mean > number / MOST else MOST
        share = math.ceil(left / (_PARTS * workers))
        return min(left, max(1, min(in_time, self._most, share)))


_TIMEOUT = 10.0
"""Time limit for a scheduler's response, and for a first worker to join [s]."""
_QUEUED_PER_WORKER = 2
"""Batches per thread that the cluster has at once: one under way, and one that begins as it ends."""
_FETCHES = (3.0, 6.0, 12.0, 24.0, 48.0)
"""For a batch's results to arrive, from time to time [s]. A worker that dies when its batch has ended takes them along:
Dask queries it in vain for half a minute, but has the batch done again meanwhile."""
_RECONNECT = 30.0
"""For a connection to the scheduler that has broken to be made again, which Dask does by itself [s]."""
_BREAKS = 10_000
"""Batches in a row that were lost so, at most: as many as the largest cluster has at once."""
_POLL = 0.01
"""Polling period of the batches under way [s]: each takes a second or so."""
_CHECK_INTERVAL = 2.0
"""Polling period for new workers [s]."""
_LOST_AFTER = 180.0
"""Time without results and workers after which a cluster is given up [s]: one whose workers a case kills at once,
time and again, has neither for half a minute."""


def dask_executor(address: str) -> ExecutorOf:
    """Executor of `run_study` that sends cases to the workers of a Dask scheduler.

    The workers need the same version of armdyn, and no files: robots are sent with the cases. One thread per worker is
    best. When a worker dies, Dask has its cases done by another one, as often as the setting
    `distributed.scheduler.allowed-failures` says (3), and then gives up; then each case is done once more, alone.

    Args:
        address: HOST:PORT.

    Raises:
        ProblemError: the address is not one.
    """
    text(address, "scheduler")
    host, colon, port = address.removeprefix("tcp://").rpartition(":")
    if not (host and colon and port.isdigit() and int(port) < 2**16):
        raise ProblemError(f"scheduler {address[:100]!r}: write HOST:PORT, such as node1:8786")
    return partial(_connected, f"tcp://{host}:{port}")


class DaskCluster:
    """Workers of a cluster, which get batches of cases that take about a second.

    Dask counts a worker's death against all batches that it had been given, so that one case that kills takes others
    with it. The cases of those that Dask gives up are therefore done once more at the end, one at a time, when nothing
    else can be to blame.
    """

    def __init__(self, client: Client, task: StudyTask):
        self._client, self._task = client, task
        self._under_way: dict[str, tuple[tuple[StudyCase, ...], Future]] = {}
        self._suspects: deque[StudyCase] = deque()
        self._alone, self._broken = False, 0
        self._deaths: dict[int, int] = {}
        self._overdue: dict[str, int] = {}
        self._batch, self._submitted = BatchSize(), 0
        self._size = max(_threads(client), 1)
        self._checked, self._without_workers = time.monotonic(), 0.0

    @property
    def size(self) -> int:
        """Number of threads of all workers."""
        return self._size

    def batch_size(self, left: int) -> int:
        """Number of cases to send as a batch now; 0 while the cluster has enough batches."""
        if self._alone or len(self._under_way) >= _QUEUED_PER_WORKER * self._size:
            return 0
        return self._batch.cases(left, self._size) if left else 0

    def give(self, cases: Sequence[StudyCase]) -> None:
        """Submit a batch."""
        key = f"armdyn-{id(self)}-{self._submitted}"
        self._submitted += 1
        future = self._client.submit(_do, self._task, tuple(cases), 2 * target(self._size), key=key, pure=False)
        self._under_way[key] = tuple(cases), future

    def ended(self, seconds: float) -> list[Ended]:
        """Wait for reports.

        Raises:
            ClusterError: the scheduler or all workers are gone.
        """
        found = list[Ended]()
        if not self._under_way:
            self._alone = bool(self._suspects)
            if self._alone:
                self.give([self._suspects.popleft()])
        until = time.monotonic() + seconds
        while not (ended := [key for key, (_, future) in self._under_way.items() if future.done()]):
            if time.monotonic() > until:
                self._check_workers()
                return []
            time.sleep(_POLL)
        self._without_workers = 0.0
        if time.monotonic() - self._checked > _CHECK_INTERVAL:
            self._check_workers()
        for key in ended:
            cases, future = self._under_way[key]
            try:
                found += self._read(cases, future, _FETCHES[self._overdue.get(key, 0)])
                del self._under_way[key]
                self._overdue.pop(key, None)
                future.release()
            except TimeoutError:  # fetched again, less often each time
                self._overdue[key] = min(self._overdue.get(key, -1) + 1, len(_FETCHES) - 1)
        return found

    def _check_workers(self) -> None:
        """Update the number of workers.

        Raises:
            ClusterError: there has been none for long, or the scheduler is gone.
        """
        if self._client.status != "running":
            self._connect()
        threads, before, self._checked = _threads(self._client), self._checked, time.monotonic()
        # A computer that slept, or was busy elsewhere, has not looked in the meantime.
        self._without_workers = 0.0 if threads else self._without_workers + min(self._checked - before, _CHECK_INTERVAL)
        if self._without_workers > _LOST_AFTER:
            raise ClusterError(f"the cluster at {_address(self._client)} has no workers any more; the rows are kept")
        self._size = max(threads, 1)

    def _connect(self) -> None:
        """Wait until the client has found its scheduler again, which has dropped all batches.

        Raises:
            ClusterError: the scheduler is gone.
        """
        until = time.monotonic() + _RECONNECT
        while self._client.status == "connecting" and time.monotonic() < until:
            time.sleep(0.1)
        self._broken += 1
        if self._client.status != "running" or self._broken > _BREAKS:
            raise ClusterError(f"the Dask scheduler at {_address(self._client)} has gone; the rows so far are kept")

    def _read(self, cases: Sequence[StudyCase], future: Future, time_limit: float) -> list[Ended]:
        """Reports on a batch; its cases become suspects where one of them may have killed the worker.

        Raises:
            ClusterError: the scheduler is gone.
            TimeoutError: the results have not arrived in this time [s]: the worker has died since, or the network is
                slow.
        """
        from distributed import KilledWorker

        try:
            done, worker = future.result(timeout=time_limit)
        except KilledWorker as error:
            for case in cases:
                self._deaths[case.k] = self._deaths.get(case.k, 0) + error.allowed_failures + 1
            if not self._alone:
                self._suspects.extend(cases)
                return []
            died = Ended(k=-1, result=None, worker=str(error.last_worker.address))
            return [replace(died, k=case.k, deaths=self._deaths[case.k], begun_from=case.begun_from) for case in cases]
        except Exception as error:
            if future.cancelled() or self._client.status != "running":
                self._connect()
                return _to_repeat(cases)
            if isinstance(error, TimeoutError):
                raise
            if len(cases) > 1:
                self._suspects.extend(cases)
                return []
            message = f"{type(error).__name__}: {error}"[:1000]  # it could not be sent, or its results not fetched
            return [Ended(k=cases[0].k, result=CaseResult(status="error", message=message))]
        self._broken = 0
        self._batch.add(len(done), sum(one.seconds for one in done))
        found = [replace(one, worker=worker, deaths=self._deaths.get(one.k, 0)) for one in done]
        return found + _to_repeat(cases[len(done) :])


@contextmanager
def _connected(address: str, task: StudyTask) -> Iterator[Executor]:
    try:
        from distributed import Client
    except ImportError:
        raise MissingPackageError(
            "armdyn[cluster]", "--scheduler", "without it, processes of this machine work"
        ) from None
    try:
        client = Client(address, timeout=_TIMEOUT, set_as_default=False, name="armdyn")
    except (OSError, TimeoutError) as error:
        raise ClusterError(f"no Dask scheduler answers at {address} ({error})"[:300]) from None
    try:
        _check(client, address)
        yield DaskCluster(client, task)
    finally:
        client.close(timeout=_TIMEOUT)  # cases under way are not begun again, and their results dropped


def _check(client: Client, address: str) -> None:
    """Check that there is a worker, and that all have this version of armdyn.

    Raises:
        ClusterError: no, or another version.
    """
    try:
        client.wait_for_workers(1, timeout=_TIMEOUT)
    except TimeoutError:
        raise ClusterError(f"the scheduler at {address} has no worker: start some, dask worker {address}") from None
    own, versions = version("armdyn"), client.run(partial(version, "armdyn"), on_error="return")
    for worker, other in versions.items():
        if other != own:
            found = f"armdyn {other}" if isinstance(other, str) else f"no armdyn ({other})"
            raise ClusterError(f"worker {worker} has {found}; this is armdyn {own}: install the same there")


def _do(task: StudyTask, cases: Sequence[StudyCase], time_limit: float) -> tuple[list[Ended], str]:
    """Do a batch on a worker; cases not begun within this time [s] are left out."""
    from distributed import get_worker

    return list(run_in_turn(task, cases, time_limit)), str(get_worker().address)


def _to_repeat(cases: Sequence[StudyCase]) -> list[Ended]:
    """Reports that make the engine submit cases again."""
    return [Ended(k=case.k, result=CaseResult(status=INTERRUPTED)) for case in cases]


def _threads(client: Client) -> int:
    return sum(client.nthreads().values())


def _address(client: Client) -> str:
    return str(client.scheduler.address if client.scheduler else "?")
