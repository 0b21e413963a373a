"""Cells of time, each with boxes that enclose the reachable positions and velocities.

Time is cut into cells: from the start on, short ones first, then one cell in the middle that is as long as the motion
wants, then cells towards the goal. A motion of any duration from the cells' own on has this shape, so that one proof
serves all durations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armdyn.arrays import Array
from armdyn.optimal.bound.enclosure.interval import Interval, joined
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.task.policy.bound import BoundPolicy

_EDGE = 1e-9
"""Share of an instant by which cells of two cuts are taken to overlap, whatever rounding makes of their ends."""


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of time in their order: those from the start, the middle one, those to the goal.

    Attributes:
        side: lengths of those from the start [s], shape (k,), and of those to the goal, back in time.
        q: positions [rad or m], shape (2 k + 1, nv).
        v: velocities [rad/s or m/s], shape (2 k + 1, nv).
        longest: no motion that takes longer [s] is spoken of.
    """

    side: Array
    q: Interval
    v: Interval
    longest: float

    @classmethod
    def of(cls, leg: BoundLeg, half: float, longest: float) -> Cells:
        """Cells within the limits of velocity alone.

        Args:
            leg: what is to be done.
            half: at most so long are the cells of each side [s]; no motion is faster than twice that.
            longest: no motion that takes longer [s] is spoken of.
        """
        side = _side(half, leg.policy)
        most = np.broadcast_to(leg.velocity, (2 * len(side) + 1, len(leg.velocity)))
        v = Interval(-most, most)
        return cls(side, _positions(leg, side, v, longest), v, longest)

    def cut(self, leg: BoundLeg, half: float) -> Cells:
        """Shorter sides, with bounds on the velocities there."""
        new = Cells.of(leg, half, self.longest)
        old, begin, k = np.cumsum(self.side), np.append(0.0, np.cumsum(new.side)), self.middle
        first = np.searchsorted(old, begin[:-1] * (1 - _EDGE))
        last = np.minimum(np.searchsorted(old, begin[1:] * (1 + _EDGE)), k - 1)
        every = [self.v[a : b + 1] for a, b in zip(first, last, strict=True)]
        back = [self.v[2 * k - b : 2 * k - a + 1] for a, b in zip(first, last, strict=True)]
        within = [Interval(x.lower.min(axis=0), x.upper.max(axis=0))[None] for x in (*every, *back[::-1])]
        middle = new.v[new.middle][None]
        return new.narrowed(leg, joined([*within[: new.middle], middle, *within[new.middle :]]))

    def narrowed(self, leg: BoundLeg, v: Interval) -> Cells:
        """Cells with further bounds on the velocities, and the positions that these admit."""
        v = self.v.meet(v)
        return Cells(self.side, self.q.meet(_positions(leg, self.side, v, self.longest)), v, self.longest)

    @property
    def lengths(self) -> Array:
        """Lengths of all cells but the middle one [s], shape (2 k,)."""
        return np.concatenate([self.side, self.side[::-1]])

    @property
    def outer(self) -> NDArray[np.intp]:
        """Indices of all cells but the middle one."""
        return np.delete(np.arange(len(self.q.lower)), self.middle)

    @property
    def middle(self) -> int:
        """Index of the middle cell."""
        return len(self.side)

    @property
    def between(self) -> float:
        """The middle cell's length in the longest motion [s]."""
        return float(np.maximum((Interval.at(self.longest) - Interval.at(self.lengths).sum(0)).upper, 0.0))


def _side(half: float, numbers: BoundPolicy) -> Array:
    """Lengths of the cells of one side [s]; their sum is half at most."""
    lengths: list[float] = []
    length = numbers.shortest
    while sum(lengths) + length < 1:
        lengths.append(length)
        length = min(length * numbers.growth, numbers.longest)
    return np.array(lengths) * (half / sum(lengths) * (1 - 1e-12))  # which rounding does not make up for


def _positions(leg: BoundLeg, side: Array, v: Interval, longest: float) -> Interval:
    """Where velocities may lead to: from the start on, from the goal back, and within the limits."""
    k = len(side)
    lengths = Interval.at(side[:, None])
    onward = leg.start.q + (lengths * v[:k]).running()
    back = leg.goal.q - (lengths * v[:k:-1]).running()
    passed = Interval.at(side).running()
    left = (Interval.at(longest) - passed - passed[-1]).upper  # until the other side's cells begin
    far = Interval.at(np.maximum(left, 0.0)[:, None]) * Interval(-leg.velocity, leg.velocity)
    from_start = onward[:-1].hull(onward[1:]).meet(back[-1] + far[:-1])
    from_goal = back[:-1].hull(back[1:]).meet(onward[-1] + far[:-1])
    middle = (onward[-1] + far[-1]).meet(back[-1] + far[-1])
    return joined([from_start, middle[None], from_goal[::-1]]).meet(leg.position)
