"""Who works on the cases, and how a worker goes through some of them."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from armdyn.studies.sweeps.tasks.settings import Value
from armdyn.studies.sweeps.tasks.task import Outcome, Task, outcome_of


@dataclass(frozen=True, kw_only=True)
class Case:
    """What is given to who works.

    Attributes:
        k: its number.
        settings: of it.
        guess: a neighbour's motion; empty: none.
        begun_from: the neighbour; None: none.
        near: its neighbours, the nearest first: one that the same worker has just done goes before a farther guess.
    """

    k: int
    settings: Mapping[str, Value]
    guess: bytes = b""
    begun_from: int | None = None
    near: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Ended:
    """What came back of a case.

    Attributes:
        k: the case.
        outcome: None: whoever worked on it died.
        seconds: that it took [s].
        worker: who it was.
        deaths: of workers that the crew has tried again by itself.
        begun_from: the case whose motion it began with; None: none.
    """

    k: int
    outcome: Outcome | None
    seconds: float = 0.0
    worker: str = ""
    deaths: int = 0
    begun_from: int | None = None


class Crew(Protocol):
    """Whoever works."""

    @property
    def size(self) -> int:
        """Cases that are worked on at once."""

    def wanted(self, left: int) -> int:
        """How many cases are to be given now, in one `give`; 0: there is enough to do.

        Args:
            left: cases that wait to be given.
        """

    def give(self, cases: Sequence[Case]) -> None:
        """Have cases worked on by one worker, one after the other."""

    def ended(self, seconds: float) -> list[Ended]:
        """What has come back, waited for so long at most [s]."""


def in_turn(task: Task, cases: Sequence[Case], patience: float) -> Iterator[Ended]:
    """Some cases, one after the other, each from the nearest motion that is there.

    Args:
        task: what is done in each.
        cases: at least one, which is done in any case.
        patience: after so long none is begun any more [s]: those that are left out are to be given again.
    """
    began, motions = time.perf_counter(), dict[int, bytes]()
    for case in cases:
        begun_from, guess = _nearest(case, motions)
        outcome, seconds = outcome_of(task, case.settings, guess)
        if outcome.motion:
            motions[case.k] = outcome.motion
        yield Ended(k=case.k, outcome=outcome, seconds=seconds, begun_from=begun_from)
        if time.perf_counter() - began > patience:
            return


def _nearest(case: Case, motions: Mapping[int, bytes]) -> tuple[int | None, bytes]:
    """Whose motion a case begins with: of those made here and the one given the nearest."""
    for k in case.near:
        if k == case.begun_from:
            break
        if k in motions:
            return k, motions[k]
    return case.begun_from, case.guess
