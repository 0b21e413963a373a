"""Arrays of affine forms: first-order enclosures over a box, with a bound of the remainder.

A form is c + Σ g_k ε_k ± r with every |ε_k| ≤ 1, ε_k the same in all forms: what is left is of second order in the
box's size, where intervals are too wide to first order, for their operands forget that they hang together (L. de
Figueiredo and J. Stolfi, Affine arithmetic: concepts and applications, Numerical Algorithms 37, 2004). Errors of
rounding are part of r.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.bound.enclosure.interval import Interval, rounding

Array = NDArray[np.float64]


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

    @classmethod
    def over(cls, boxes: Interval) -> Affine:
        """The coordinates of boxes, shape (nv, boxes): ε_k is how far the k-th is from the middle."""
        slopes = np.eye(len(boxes.lower))[:, :, None] * boxes.radius
        return cls(boxes.centre, slopes, np.zeros_like(boxes.lower))

    @property
    def parts(self) -> tuple[Array, ...]:
        """The arrays that it is made of."""
        return self.centre, self.slopes, self.rest

    @staticmethod
    def number(value: float) -> tuple[float, ...]:
        """A float's parts."""
        return value, 0.0, 0.0

    @property
    def interval(self) -> Interval:
        """Interval hull."""
        far = self.far
        beside = far + rounding(2, far + np.abs(self.centre))
        return Interval(self.centre - beside, self.centre + beside)

    def __neg__(self) -> Affine:
        return Affine(-self.centre, -self.slopes, self.rest)

    def __add__(self, other: Affine) -> Affine:
        return self._rounded(self.centre + other.centre, self.slopes + other.slopes, self.rest + other.rest)

    def __sub__(self, other: Affine) -> Affine:
        return self._rounded(self.centre - other.centre, self.slopes - other.slopes, self.rest + other.rest)

    def __mul__(self, other: Affine) -> Affine:
        a, b = self.centre, other.centre
        slopes = a[:, None] * other.slopes + b[:, None] * self.slopes
        squares = self.slopes * other.slopes  # of ε_k², which is ½ ± ½
        middle, half = np.sum(squares, axis=1) / 2, np.sum(np.abs(squares), axis=1) / 2
        far, own = self.far, other.far
        size_a, size_b = np.abs(a), np.abs(b)
        rest = size_a * other.rest + size_b * self.rest + (far * own - half)
        beside = rounding(2 * self.slopes.shape[1] + 8, (size_a + far) * (size_b + own))
        return Affine(a * b + middle, slopes, rest + beside)

    def square(self) -> Affine:
        """x²."""
        return self * self

    def sin(self) -> Affine:
        """Sines."""
        return self._wave(0.0)

    def cos(self) -> Affine:
        """Cosines."""
        return self._wave(np.pi / 2)

    @property
    def far(self) -> Array:
        """How far from the centre, at most, but for rounding."""
        return np.asarray(np.sum(np.abs(self.slopes), axis=1) + self.rest)

    def _wave(self, phase: float) -> Affine:
        """sin(x + phase): the line s d of least squares over d = x − c, |d| ≤ far, and the range of what it leaves.

        What is left, sin(x + phase) − s d, is greatest and least at an end or where cos(x + phase) = s.
        """
        middle, far = self.centre + phase, self.far
        small = far < 1e-2  # where differences of nearly equal numbers would say nothing
        safe = np.where(small, 1.0, far)
        share = np.where(small, 1 - far**2 / 10, 3 * (np.sin(safe) - safe * np.cos(safe)) / safe**3)
        slope = np.cos(middle) * np.where(far < np.pi, share, 0.0)
        stays = np.arccos(np.clip(slope, -1, 1))
        turns = 2 * np.pi * np.round(middle / (2 * np.pi))
        away = [side * stays + turn * 2 * np.pi - (middle - turns) for side in (-1.0, 1.0) for turn in (-1, 0, 1)]
        ends = [-far, far, *(np.clip(d, -far, far) for d in away)]
        left = np.array([np.sin(middle + d) - slope * d for d in ends])
        lower, upper = np.min(left, axis=0), np.max(left, axis=0)
        lower, upper = np.where(far < np.pi, lower, -1.0), np.where(far < np.pi, upper, 1.0)
        rest = (upper - lower) / 2 + np.abs(slope) * self.rest
        return Affine((lower + upper) / 2, slope[:, None] * self.slopes, rest + rounding(64, 4 + np.abs(middle) + far))

    def _rounded(self, centre: Array, slopes: Array, rest: Array) -> Affine:
        """With the errors of one rounding of each part."""
        size = np.abs(centre) + np.sum(np.abs(slopes), axis=1) + rest
        return Affine(centre, slopes, rest + rounding(slopes.shape[1] + 2, size))
