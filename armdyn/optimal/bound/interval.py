"""Arrays of intervals, rounded outward.

A sum, difference or product of floats is rounded to nearest, so that the next float outward, or the one after, is a
bound. Products of matrices and running sums use the a-priori bound instead (N. Higham, Accuracy and Stability of
Numerical Algorithms, 2nd ed. 2002, section 3.1): n terms err by at most γ = n u/(1 − n u) of the sum of their sizes,
u = 2⁻⁵³.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array

_UNIT = 2.0**-53
"""Unit roundoff u of a float."""

_LEAST, _LARGEST = 5e-324, float(np.finfo(float).max)
"""Least and largest positive float."""

_TINY = 1e-300
"""Bound on underflow in sums [unit of the sum]."""

_LIBRARY = 1e-15
"""Error of the mathematical library's tanh: 9 ulp of 1; vendors state at most 4."""


@dataclass(frozen=True, eq=False)
class Interval:
    """Intervals, one per place of two arrays.

    Attributes:
        lower: lower ends, of any shape.
        upper: upper ends, likewise; not below the lower ends.
    """

    lower: Array
    upper: Array

    @classmethod
    def at(cls, value: ArrayLike) -> Interval:
        """Intervals of zero width at given numbers."""
        exact = np.asarray(value, dtype=float)
        return cls(exact, exact)

    @property
    def magnitude(self) -> Array:
        """Largest |x| of each interval."""
        return np.maximum(np.abs(self.lower), np.abs(self.upper))

    @property
    def mignitude(self) -> Array:
        """Smallest |x| of each interval."""
        return np.maximum(np.maximum(self.lower, -self.upper), 0.0)

    @property
    def centre(self) -> Array:
        """A float in the middle of each interval."""
        return np.asarray(np.minimum(np.maximum(self.lower / 2 + self.upper / 2, self.lower), self.upper))

    @property
    def radius(self) -> Array:
        """Largest distance of the ends from `centre`."""
        centre = self.centre
        return np.where(self.lower == self.upper, 0.0, up(np.maximum(self.upper - centre, centre - self.lower)))

    def __getitem__(self, key: Any) -> Interval:
        return Interval(self.lower[key], self.upper[key])

    def __neg__(self) -> Interval:
        return Interval(-self.upper, -self.lower)

    def __add__(self, other: Interval) -> Interval:
        return Interval(down(self.lower + other.lower), up(self.upper + other.upper))

    def __sub__(self, other: Interval) -> Interval:
        return Interval(down(self.lower - other.upper), up(self.upper - other.lower))

    def __mul__(self, other: Interval) -> Interval:
        return _hull(x * y for x in (self.lower, self.upper) for y in (other.lower, other.upper))

    def __truediv__(self, other: Interval) -> Interval:
        """Quotient; the divisor must not contain zero."""
        return _hull(x / y for x in (self.lower, self.upper) for y in (other.lower, other.upper))

    def tanh(self) -> Interval:
        """Hyperbolic tangents."""
        return Interval(
            np.maximum(np.tanh(self.lower) - _LIBRARY, -1.0), np.minimum(np.tanh(self.upper) + _LIBRARY, 1.0)
        )

    def outward(self) -> Interval:
        """Round outward once more."""
        return Interval(down(self.lower), up(self.upper))

    def meet(self, other: Interval) -> Interval:
        """Intersection; if empty by rounding, the nearer ends."""
        lower, upper = np.maximum(self.lower, other.lower), np.minimum(self.upper, other.upper)
        return Interval(np.minimum(lower, upper), np.maximum(lower, upper))

    def intersection(self, other: Interval) -> Interval:
        """Intersection; empty if the lower end is above the upper one."""
        return Interval(np.maximum(self.lower, other.lower), np.minimum(self.upper, other.upper))

    @property
    def around(self) -> Interval:
        """Hull along the first axis."""
        return Interval(np.min(self.lower, axis=0), np.max(self.upper, axis=0))

    def hull(self, other: Interval) -> Interval:
        """Convex hull of the union."""
        return Interval(np.minimum(self.lower, other.lower), np.maximum(self.upper, other.upper))

    def turned(self, axes: tuple[int, ...]) -> Interval:
        """Transpose."""
        return Interval(
            np.ascontiguousarray(self.lower.transpose(axes)), np.ascontiguousarray(self.upper.transpose(axes))
        )

    def shaped(self, shape: tuple[int, ...]) -> Interval:
        """Reshape."""
        return Interval(self.lower.reshape(shape), self.upper.reshape(shape))

    def spread(self, shape: tuple[int, ...]) -> Interval:
        """The interval broadcast to a greater shape."""
        return Interval(np.broadcast_to(self.lower, shape), np.broadcast_to(self.upper, shape))

    def dot(self, other: Interval) -> Interval:
        """The matrix product with another, shapes (…, l, m) with (…, m, n)."""
        product = self.times(other.centre)
        radius = self.magnitude @ other.radius
        radius = radius + rounding(self.lower.shape[-1], radius)
        return Interval(down(product.lower - radius), up(product.upper + radius))

    def times(self, matrix: Array) -> Interval:
        """The product with a matrix of floats on the right, shapes (…, m) or (…, l, m) with (…, m, n)."""
        plus, minus = np.maximum(matrix, 0.0), np.maximum(-matrix, 0.0)
        error = rounding(2 * matrix.shape[-2], self.magnitude @ np.abs(matrix))
        return Interval(self.lower @ plus - self.upper @ minus - error, self.upper @ plus - self.lower @ minus + error)

    def sum(self, axis: int) -> Interval:
        """Sum along an axis."""
        error = rounding(self.lower.shape[axis], np.sum(self.magnitude, axis))
        return Interval(np.sum(self.lower, axis) - error, np.sum(self.upper, axis) + error)

    def running(self) -> Interval:
        """Partial sums along the first axis, from none to all, shape (n + 1, …)."""
        sizes = _from_zero(np.cumsum(self.magnitude, 0))
        error = rounding(len(self.lower), sizes)
        return Interval(_from_zero(np.cumsum(self.lower, 0)) - error, _from_zero(np.cumsum(self.upper, 0)) + error)

    def propagated(self, ways: Interval) -> Interval:
        """Tighten each box along the first axis by all boxes before it, plus the displacements to it.

        The least of a box's upper ends and those of all boxes before it, each plus the sum of the displacements since;
        likewise for lower ends.
        """
        sizes = _from_zero(np.cumsum(ways.magnitude, 0))
        low, high = (_from_zero(np.cumsum(end, 0)) for end in (ways.lower, ways.upper))
        most, least = np.minimum.accumulate(self.upper - high), np.maximum.accumulate(self.lower - low)
        below, above = (rounding(len(sizes) + 2, 2 * sizes + np.abs(end)) for end in (least, most))
        return self.intersection(Interval(low + least - below, high + most + above))


def joined(parts: Sequence[Interval]) -> Interval:
    """Intervals joined along the first axis."""
    return Interval(np.concatenate([x.lower for x in parts]), np.concatenate([x.upper for x in parts]))


def stacked(parts: Sequence[Interval], axis: int) -> Interval:
    """Intervals of one shape along a new axis."""
    return Interval(np.stack([x.lower for x in parts], axis), np.stack([x.upper for x in parts], axis))


def _hull(ends: Iterable[Array]) -> Interval:
    """The interval hull of four arrays, rounded outward."""
    a, b, c, d = ends
    return Interval(
        down(np.minimum(np.minimum(a, b), np.minimum(c, d))), up(np.maximum(np.maximum(a, b), np.maximum(c, d)))
    )


def down(x: Array) -> Array:
    """Round down by at most two floats, see `_step`."""
    return np.asarray(np.minimum(x - _step(x), _LARGEST))


def up(x: Array) -> Array:
    """Round up by at most two floats."""
    return np.asarray(np.maximum(x + _step(x), -_LARGEST))


def _step(x: Array) -> Array:
    """Step from each float to at least the next one and at most two, in a fifth of the time of `numpy.nextafter`.

    S. Rump, P. Zimmermann, S. Boldo, G. Melquiond, Computing predecessor and successor in rounding to nearest, BIT 49,
    2009: u (1 + 2 u) |x| + the least subnormal number.
    """
    return np.asarray(np.minimum(np.abs(x), _LARGEST) * (_UNIT * (1 + 2 * _UNIT)) + _LEAST)


def sum_down(numbers: Sequence[float]) -> float:
    """Sum, rounded down."""
    total = 0.0
    for number in numbers:
        total = number if total == 0 else float(down(np.array(total + number)))
    return total


def rounding(terms: int, sizes: Array) -> Array:
    """Upper bound on the rounding error of a sum of products, from the sum of their sizes.

    Four times γ, because that sum and operations on the result are rounded, too.
    """
    return np.asarray(4 * (terms + 2) * _UNIT * sizes + _TINY)


def _from_zero(sums: Array) -> Array:
    return np.concatenate([np.zeros_like(sums[:1]), sums])


TURN = Interval(down(np.array(2 * np.pi)), up(np.array(2 * np.pi)))
"""A whole turn [rad]."""
