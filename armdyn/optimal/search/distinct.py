"""Which of many answers are one optimum."""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np

from armdyn.optimal.solve.attempt import Attempt

Item = TypeVar("Item")


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
    """Usable attempts, best first; of those with about the same duration and motion only that on the finest mesh.

    Args:
        attempts: in any order.
        same: largest relative difference of durations that are one optimum's.
        apart: largest distance of motions that are one optimum's, at the same part of their durations [rad or m].
    """
    groups, first = list[list[Attempt]](), 0
    for attempt in ranked(attempts):
        if not attempt.usable:
            break
        duration = attempt.trajectory.duration
        while first < len(groups) and duration > groups[first][0].trajectory.duration * (1 + same):
            first += 1  # later attempts are slower still
        own = next((group for group in groups[first:] if _near(group[0], attempt, apart)), None)
        if own is None:
            groups.append([attempt])
        else:
            own.append(attempt)
    return [max(group, key=lambda attempt: attempt.intervals) for group in groups]


def _near(one: Attempt, other: Attempt, apart: float) -> bool:
    return apart == np.inf or float(np.abs(one.quarters - other.quarters).max()) <= apart
