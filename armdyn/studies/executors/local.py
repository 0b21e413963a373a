"""Cases done in processes of this machine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from armdyn.parallel import ForkPool, fork_pool
from armdyn.studies.executors.executor import Ended, Executor, StudyCase, run_in_turn
from armdyn.studies.tasks.task import StudyTask


class LocalProcesses:
    """Processes of this machine, each with one case at a time."""

    def __init__(self, workers: ForkPool[Ended]):
        self._workers = workers
        self._begun_from: dict[int, int | None] = {}

    @property
    def size(self) -> int:
        """Number of processes."""
        return self._workers.count

    def wanted(self, left: int) -> int:
        """One case, while a process is idle."""
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
