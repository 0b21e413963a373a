"""Which of many answers are one optimum."""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np

from armdyn.optimal.solve.attempt import Attempt

Item = TypeVar("Item")

_LOOKED_AT = np.array([0.25, 0.5, 0.75])
"""Parts of a motion's duration."""


def grouped(items: Iterable[Item], alike: Callable[[Item, Item], bool]) -> list[list[Item]]:
    """Items in groups: each joins the first group whose first member it is like, or begins one.

    Args:
        items: best first.
        alike: whether a later item is the same as a group's first.
    """
    groups: list[list[Item]] = []
    for item in items:
        group = next((group for group in groups if alike(group[0], item)), None)
        if group is None:
            groups.append([item])
        else:
            group.append(item)
    return groups


def within(same: float) -> Callable[[float, float], bool]:
    """Whether a number exceeds a smaller one by no more than a part of it."""
    return lambda first, item: item <= first * (1 + same)


def ranked(attempts: Sequence[Attempt]) -> list[Attempt]:
    """Usable ones by duration, then the rest."""
    return sorted(attempts, key=lambda a: (not a.usable, a.trajectory.duration))


def distinct(attempts: Sequence[Attempt], same: float, apart: float = np.inf) -> list[Attempt]:
    """Usable attempts of which no two have about the same duration and motion, best first; of those the finest mesh's.

    Args:
        attempts: in any order.
        same: durations that differ by no more than this part are one optimum's,
        apart: if the motions are nowhere so far from each other at the same part of them [rad or m].
    """
    alike = within(same)

    def one(first: Attempt, item: Attempt) -> bool:
        return alike(first.trajectory.duration, item.trajectory.duration) and (
            apart == np.inf or _between(first, item) <= apart
        )

    groups = grouped((attempt for attempt in ranked(attempts) if attempt.usable), one)
    return [max(group, key=lambda attempt: attempt.intervals) for group in groups]


def _between(first: Attempt, other: Attempt) -> float:
    """How far two motions are from each other, where each has gone through a quarter, a half and three of its time."""
    one, two = (motion(motion.t[0] + _LOOKED_AT * motion.duration).q for motion in (first.trajectory, other.trajectory))
    return float(np.max(np.abs(one - two)))
