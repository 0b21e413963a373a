"""Work on the bounds of a chain's legs: counted, and in parallel processes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np

from armdyn.arguments import StopCondition
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.leg_bound import Passage, leg_bound, passing_bound
from armdyn.parallel import in_processes

Item = TypeVar("Item")


class Stopped(Exception):  # noqa: N818  # not an error
    """The work was stopped before there were bounds."""


def polled(items: Iterable[Item], stop: StopCondition) -> Iterator[Item]:
    """Yield items; raise once the stop condition holds.

    Raises:
        Stopped: the stopping condition is true before one.
    """
    for item in items:
        if stop():
            raise Stopped
        yield item


@dataclass(frozen=True, eq=False)
class Edge:
    """A leg between two regions whose bound is to be improved.

    Attributes:
        leg: index of the leg.
        motion: motion between the regions.
        passage: regions and lines on the way; None: not considered yet.
        known: bound so far [s].
        most: bound beyond which improvement is useless [s].
    """

    leg: int
    motion: BoundLeg
    passage: Passage | None
    known: float
    most: float

    def bounded(self, stop: StopCondition) -> tuple[float, bool, int]:
        """The bound [s], whether further tries would gain nothing, and the number of linear programs."""
        counted = _Counted(stop)
        if not np.all(np.isfinite(self.motion.away.magnitude)):
            return self.known, True, 1
        if self.passage is None:
            return leg_bound(self.motion, counted, self.known)[0], True, counted.programs
        return *passing_bound(self.motion, self.passage, self.known, self.most, counted), counted.programs


@dataclass(eq=False)
class _Counted:
    """Stopping condition that counts its polls: one per linear program."""

    stop: StopCondition
    programs: int = 0

    def __call__(self) -> bool:
        self.programs += 1
        return self.stop()


@dataclass(eq=False)
class Effort:
    """Budget of work on bounds: a count, so that it is the same on every machine.

    Attributes:
        left: number of linear programs left, 0.02 to 0.1 s each; started edges are finished.
        stop: stopping condition, polled regularly; once true, the bounds so far are kept.
        workers: largest number of processes; None: one per core. The bounds do not depend on it.
        report: called with a line of text.
        others: bound of the other motions, and rests, for the report [s].
    """

    left: float
    stop: StopCondition = lambda: False
    workers: int | None = 1
    report: Callable[[str], object] = lambda text: None
    others: float = 0.0

    def __bool__(self) -> bool:
        return self.left > 0 and not self.stop()

    def report_bound(self, bound: float) -> None:
        """Report the bound so far [s] of the motions under work."""
        self.report(f"proven: not below {self.others + bound:.4f} s; {max(self.left, 0):.0f} linear programs are left")

    def spent_on(self, edges: Sequence[Edge]) -> list[tuple[float, bool]]:
        """Bounds of edges [s], and whether further tries would gain nothing."""
        found = list(in_processes([partial(edge.bounded, self.stop) for edge in edges], self.workers))
        self.left -= sum(programs for _, _, programs in found)
        return [(bound, done) for bound, done, _ in found]

    @contextmanager
    def shared(self, count: int) -> Iterator[Effort]:
        """Context in which one of `count` equal parts of the effort left may be spent."""
        kept = self.left * (1 - 1 / count)
        self.left -= kept
        yield self
        self.left += kept
