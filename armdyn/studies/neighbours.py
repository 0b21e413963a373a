"""Nearest neighbours among the cases of a study."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

_NEAR = 12
"""Neighbours of a case that are looked at, the nearest first."""
_SAME_ARM = 10.0
"""Cases farther than that from each other, in ranges, are of other arms."""


def neighbours_of(points: NDArray[np.float64]) -> Callable[[int], tuple[int, ...]]:
    """Function from a case's number to those of its neighbours, the nearest first.

    Args:
        points: places of the cases, shape (cases, axes).
    """
    from scipy.spatial import cKDTree

    tree, count = cKDTree(points), min(_NEAR, len(points) - 1)

    def near(k: int) -> tuple[int, ...]:
        if not count:
            return ()
        distances, numbers = tree.query(points[k], k=count + 1)
        pairs = zip(distances, numbers, strict=True)
        return tuple(int(n) for distance, n in pairs if distance <= _SAME_ARM and int(n) != k)

    return near
