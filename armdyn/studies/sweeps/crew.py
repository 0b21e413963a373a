"""Who works on the cases: processes of this machine, or someone else's cluster."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

from armdyn.processes import Workers, workers_of
from armdyn.studies.sweeps.tasks.settings import Value
from armdyn.studies.sweeps.tasks.task import Outcome, Task, outcome_of


@dataclass(frozen=True, kw_only=True)
class Case:
    """What is given to who works.

    Attributes:
        k: its number.
        settings: of it.
        guess: a neighbour's motion; empty: none.
    """

    k: int
    settings: Mapping[str, Value]
    guess: bytes = b""


@dataclass(frozen=True, kw_only=True)
class Ended:
    """What came back.

    Attributes:
        k: the case.
        outcome: None: whoever worked on it died.
        seconds: that it took [s].
        worker: who it was.
        deaths: of workers that the crew has tried again by itself.
    """

    k: int
    outcome: Outcome | None
    seconds: float = 0.0
    worker: str = ""
    deaths: int = 0


class Crew(Protocol):
    """Whoever works."""

    @property
    def size(self) -> int:
        """Cases that are worked on at once."""

    @property
    def room(self) -> int:
        """Cases that may be given now."""

    def give(self, case: Case) -> None:
        """Have a case worked on."""

    def ended(self, seconds: float) -> list[Ended]:
        """What has come back, waited for so long at most [s]."""


class LocalCrew:
    """Processes of this machine."""

    def __init__(self, workers: Workers[tuple[Outcome, float]]):
        self._workers = workers

    @property
    def size(self) -> int:
        """Processes."""
        return self._workers.count

    @property
    def room(self) -> int:
        """Of them, how many do nothing."""
        return self._workers.idle

    def give(self, case: Case) -> None:
        """Have a case worked on."""
        self._workers.give(case.k, case)

    def ended(self, seconds: float) -> list[Ended]:
        """What has come back."""
        return [
            Ended(k=k, outcome=None, worker=f"process {process}")
            if result is None
            else Ended(k=k, outcome=result[0][0], seconds=result[0][1], worker=f"process {process}")
            for k, process, result in self._workers.ended(seconds)
        ]


@contextmanager
def local_crew(task: Task, workers: int | None = None) -> Iterator[Crew]:
    """Processes of this machine for as long as a study takes; they end with this process, however it ends.

    Args:
        task: what they do.
        workers: processes; None: one per core.
    """
    count = workers or len(os.sched_getaffinity(0))

    def do(case: Case) -> tuple[Outcome, float]:
        return outcome_of(task, case.settings, case.guess)

    with workers_of(do, count) as crew:
        yield LocalCrew(crew)
