"""Which cases of a study are near a case, and have a motion that its search may begin with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armdyn.studies.sweeps.study import Study
from armdyn.studies.sweeps.tasks.settings import ARM

_NEAR = 12
"""Neighbours of a case that are looked at, the nearest first."""
_SAME_ARM = 10.0
"""Cases farther than that from each other, in ranges, are of other arms."""


class Neighbours:
    """Of every case, those that are near.

    Attributes:
        moved: cases that have a motion.
    """

    def __init__(self, study: Study, moved: set[int]):
        from scipy.spatial import cKDTree

        self.moved = moved
        self._points = _apart(study)
        self._tree = cKDTree(self._points)
        self._near = min(_NEAR, len(study) - 1)

    def near(self, k: int) -> tuple[int, ...]:
        """Cases of the same arm, the nearest first, whether they have a motion or not."""
        if not self._near:
            return ()
        distances, numbers = self._tree.query(self._points[k], k=self._near + 1)
        pairs = zip(distances, numbers, strict=True)
        return tuple(int(n) for distance, n in pairs if distance <= _SAME_ARM and int(n) != k)


def _apart(study: Study) -> NDArray[np.float64]:
    """Where cases are, with arms so far from each other that none is another's neighbour, shape (cases, axes)."""
    points = study.points.copy()
    for column, axis in enumerate(study.axes):
        if axis.name == ARM:
            points[:, column] *= 100 * len(axis.values)
    return points
