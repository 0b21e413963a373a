"""B-spline basis on a clamped mesh.

De Boor, A Practical Guide to Splines, 1978, chapters IX to XI.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import brentq

from armdyn.arrays import Array, Index
from armdyn.locks import cached_property

DEGREE = 4
"""Degree of positions: accelerations are quadratic between breaks, and torques have no corners."""
WINDOW = DEGREE + 1
"""Number of control points on which an interval of a curve depends."""


def graded(intervals: int, shortest: float, longest: float = 1.0, ends: tuple[bool, bool] = (True, True)) -> Array:
    """Breaks from 0 to 1 whose distances grow geometrically from the ends, shape (intervals + 1,).

    Args:
        intervals: number of intervals.
        shortest: length of the first and the last interval, as a part of the whole.
        longest: largest length of an interval; exceeded if the intervals are too few.
        ends: whether the lengths grow from the start, and from the end.
    """
    if not any(ends):
        return np.linspace(0, 1, intervals + 1)
    count = np.arange(intervals)
    steps = np.minimum(count if ends[0] else intervals, count[::-1] if ends[1] else intervals)

    def lengths(growth: float) -> Array:
        return np.minimum(shortest * np.exp(np.minimum(growth * steps, 700.0)), longest)

    def beyond(growth: float) -> float:
        return float(np.log(np.sum(lengths(growth))))

    can_grow = intervals > 2 and beyond(0.0) < 0 and intervals * longest > 1
    growth = brentq(beyond, 0.0, -np.log(shortest)) if can_grow else 0.0
    breaks = np.cumsum(lengths(growth))
    return np.append(0.0, breaks / breaks[-1])


@dataclass(frozen=True, eq=False)
class Basis:
    """B-splines of degree `DEGREE` on a clamped mesh from 0 to 1: a curve starts and ends at a control point.

    Attributes:
        breaks: breaks of the mesh, shape (intervals + 1,).
    """

    breaks: Array

    @property
    def intervals(self) -> int:
        """Number of intervals."""
        return self.breaks.size - 1

    @property
    def size(self) -> int:
        """Number of control points of a curve."""
        return self.intervals + DEGREE

    @cached_property
    def knots(self) -> Array:
        """Breaks, the ends repeated, shape (size + DEGREE + 1,)."""
        return np.concatenate([np.zeros(DEGREE), self.breaks, np.ones(DEGREE)])

    @cached_property
    def places(self) -> Array:
        """Greville abscissae, shape (size,)."""
        return np.array([self.knots[i + 1 : i + 1 + DEGREE].mean() for i in range(self.size)])

    def monomials(self) -> tuple[Array, Array]:
        """Control points of s and of s², each of shape (size,): symmetric functions of the knots (chapter IX)."""
        inner = np.array([self.knots[i + 1 : i + 1 + DEGREE] for i in range(self.size)])
        sums, squares = np.sum(inner, axis=1), np.sum(inner**2, axis=1)
        return sums / DEGREE, (sums**2 - squares) / (DEGREE * (DEGREE - 1))

    def factors(self, order: int) -> Array:
        """Factors from differences of a derivative's control points to the control points of the next derivative.

        Args:
            order: order of the resulting derivative, from 1.

        Returns:
            Shape (size - order,).
        """
        degree, knots = DEGREE - order + 1, self.knots[order - 1 : self.knots.size - order + 1]
        first = np.arange(self.size - order) + 1
        return np.asarray(degree / (knots[first + degree] - knots[first]))

    def differences(self, order: int) -> Array:
        """Factors from neighbouring control points to those of a derivative, shape (size - order, order + 1)."""
        matrix = np.eye(self.size)
        for k in range(1, order + 1):
            matrix = self.factors(k)[:, None] * np.diff(matrix, axis=0)
        window = np.arange(len(matrix))[:, None] + np.arange(order + 1)
        return np.take_along_axis(matrix, window, axis=1)

    def gauss(self, points: int) -> tuple[Array, Array]:
        """Gauss points in every interval and their weights, each of shape (intervals, points)."""
        nodes, weights = np.polynomial.legendre.leggauss(points)
        lengths = np.diff(self.breaks)[:, None]
        return self.breaks[:-1, None] + lengths * (nodes + 1) / 2, lengths * weights / 2

    def squared(self, order: int, points: int) -> Array:
        """Integrals over s of products of two B-splines' derivatives, shape (size, size).

        Args:
            order: order of the derivative.
            points: number of Gauss points per interval.
        """
        s, weights = (each.ravel() for each in self.gauss(points))
        values = self.values(s, order)
        return np.asarray(values.T @ (weights[:, None] * values))

    def values(self, s: Array, order: int) -> Array:
        """Derivatives of all B-splines at s, shape (m, size)."""
        return np.asarray(BSpline(self.knots, np.eye(self.size), DEGREE)(s, order))

    def interval_of(self, s: Array) -> Index:
        """Index of the interval that contains each s, of the shape of s."""
        return np.clip(np.searchsorted(self.breaks, s, side="right") - 1, 0, self.intervals - 1)

    def window(self, s: Array) -> Index:
        """Indices of the control points on which a curve depends at s, shape (m, WINDOW)."""
        return self.interval_of(s)[:, None] + np.arange(WINDOW)

    def local(self, s: Array, derivatives: int = 2) -> Array:
        """Values and derivatives of the nonzero B-splines at s.

        Args:
            s: places from 0 to 1, shape (m,).
            derivatives: highest order.

        Returns:
            Shape (m, derivatives + 1, WINDOW), for the control points of `window`.
        """
        window, orders = self.window(s), range(derivatives + 1)
        return np.stack([np.take_along_axis(self.values(s, order), window, axis=1) for order in orders], axis=1)

    def curve(self, points: Array) -> BSpline:
        """B-spline over s with given control points, shape (size, nv)."""
        return BSpline(self.knots, points, DEGREE)
