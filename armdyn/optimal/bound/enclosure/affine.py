"""Arrays of affine forms: first-order enclosures over a box, with a bound of the remainder.

A form is c + Σ g_k ε_k ± r with every |ε_k| ≤ 1, ε_k the same in all forms: the overestimation is of second order in
the box's size, where intervals, which lose the dependence of their operands, are of first order (L. de Figueiredo and
J. Stolfi, Affine arithmetic: concepts and applications, Numerical Algorithms 37, 2004). Errors of rounding are part of
r. Their arithmetic is in `_enclosure/affine_forms.cpp`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.bound.enclosure.interval import Interval, rounding


@dataclass(frozen=True, eq=False)
class Affine:
    """Affine forms, one per place, over several boxes at once.

    Attributes:
        centre: c, shape (places, boxes).
        slopes: g, shape (places, nv, boxes).
        rest: r, not negative, shape (places, boxes).
    """

    centre: Array
    slopes: Array
    rest: Array

    @property
    def parts(self) -> tuple[Array, ...]:
        """The arrays of the forms."""
        return self.centre, self.slopes, self.rest

    @property
    def far(self) -> Array:
        """Largest distance from the centre, before rounding."""
        return np.asarray(np.sum(np.abs(self.slopes), axis=1) + self.rest)

    @property
    def interval(self) -> Interval:
        """Interval hull."""
        far = self.far
        radius = far + rounding(2 + self.slopes.shape[1], far + np.abs(self.centre))
        return Interval(self.centre - radius, self.centre + radius)

    def __sub__(self, other: Affine) -> Affine:
        centre, slopes, rest = self.centre - other.centre, self.slopes - other.slopes, self.rest + other.rest
        size = np.abs(centre) + np.sum(np.abs(slopes), axis=1) + rest
        return Affine(centre, slopes, rest + rounding(slopes.shape[1] + 2, size))
