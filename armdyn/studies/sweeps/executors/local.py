"""A study's cases in processes of this machine."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

from armdyn.parallel import Workers, workers_of
from armdyn.studies.sweeps.executors.executor import Case, Crew, Ended, in_turn
from armdyn.studies.sweeps.tasks.task import Task


class LocalCrew:
    """Processes of this machine, each with one case at a time."""

    def __init__(self, workers: Workers[Ended]):
        self._workers = workers
        self._begun_from: dict[int, int | None] = {}

    @property
    def size(self) -> int:
        """Processes."""
        return self._workers.count

    def wanted(self, left: int) -> int:
        """One case while a process does nothing."""
        return min(self._workers.idle, left, 1)

    def give(self, cases: Sequence[Case]) -> None:
        """Have cases worked on."""
        for case in cases:
            self._begun_from[case.k] = case.begun_from
            self._workers.give(case.k, case)

    def ended(self, seconds: float) -> list[Ended]:
        """What has come back."""
        found = list[Ended]()
        for k, process, result in self._workers.ended(seconds):
            begun_from = self._begun_from.pop(k)
            one = result[0] if result else Ended(k=k, outcome=None, begun_from=begun_from)
            found.append(replace(one, worker=f"process {process}"))
        return found


@contextmanager
def local_crew(task: Task, workers: int | None = None) -> Iterator[Crew]:
    """Processes of this machine for as long as a study takes; they end with this process, however it ends.

    Args:
        task: what they do.
        workers: processes; None: one per core.
    """
    count = workers or len(os.sched_getaffinity(0))

    def do(case: Case) -> Ended:
        return next(in_turn(task, [case], 0.0))

    with workers_of(do, count) as crew:
        yield LocalCrew(crew)
