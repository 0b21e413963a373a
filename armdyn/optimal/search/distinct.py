"""Clustering of solutions that are the same local optimum."""

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np

from armdyn.optimal.solve.attempt import Attempt

Item = TypeVar("Item")


def grouped(items: Iterable[Item], alike: Callable[[Item, Item], bool]) -> list[list[Item]]:
    """Group items: each joins the first group whose first member is alike, or starts a group.

    Args:
        items: best first.
        alike: whether a later item equals a group's first.
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
    """Predicate: a number exceeds a smaller one by at most a part of the smaller one."""
    return lambda first, item: item <= first * (1 + same)


def ranked(attempts: Sequence[Attempt]) -> list[Attempt]:
    """Usable attempts by duration, then the rest."""
    return sorted(attempts, key=lambda a: (not a.usable, a.trajectory.duration))


def distinct(attempts: Sequence[Attempt], same: float, apart: float = np.inf) -> list[Attempt]:
    """Usable attempts, best first, one per optimum: the one on the finest mesh.

    Args:
        attempts: in any order.
        same: largest relative difference of durations within one optimum.
        apart: largest distance of motions within one optimum, at the same part of their durations [rad or m].
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
