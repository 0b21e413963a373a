"""Distances of many runs from their reference over time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import parts as parts_of
from armdyn.arrays import Array
from armdyn.reprs import brief


@brief
@dataclass(frozen=True, eq=False)
class Envelope:
    """Least, greatest and quantiles of the joints' distances from a reference, of many runs, time by time.

    Attributes:
        t: times [s], shape (n,).
        low: of all runs the least distance [rad or m], shape (n, nv).
        high: the greatest, likewise; inf from where on a run broke off.
        parts: of the runs, whose distances `quantiles` has, shape (m,), increasing.
        quantiles: distances that so many runs do not exceed [rad or m], shape (m, n, nv).
        joint_names: one per joint.
        duration: of the reference [s].
        tolerance: of a joint's distance from the goal, to be settled [rad or m].
        count: of runs.
    """

    t: Array
    low: Array
    high: Array
    parts: Array
    quantiles: Array
    joint_names: tuple[str, ...]
    duration: float
    tolerance: float
    count: int

    @classmethod
    def of(
        cls,
        t: Array,
        errors: NDArray[Any],
        parts: Sequence[float],
        joint_names: tuple[str, ...],
        duration: float,
        tolerance: float,
    ) -> Self:
        """Envelope of all distances; each quantile is the distance of a run.

        Args:
            t: times [s], shape (n,).
            errors: distances [rad or m], shape (runs, n, nv); inf from where on a run broke off.
            parts: see above.
            joint_names: see above.
            duration: see above.
            tolerance: see above.

        Raises:
            ProblemError: a part is not in 0 to 1.
        """
        own = np.sort(parts_of(parts, "parts"))
        quantiles = np.quantile(errors, own, axis=0, method="inverted_cdf").astype(float)
        low, high = errors.min(axis=0).astype(float), errors.max(axis=0).astype(float)
        return cls(t, low, high, own, quantiles, joint_names, duration, tolerance, len(errors))
