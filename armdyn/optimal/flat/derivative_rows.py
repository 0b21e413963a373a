"""Limits of a curve's time derivatives, by the control points of these, linearised."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import scipy.sparse as sp

from armdyn.arrays import Array, Flags, Index
from armdyn.optimal.flat.basis import Basis
from armdyn.optimal.flat.convex_step import both_sides
from armdyn.optimal.flat.program import CurveLayout


@dataclass(frozen=True, eq=False)
class Sides:
    """Rows low <= g <= high at an iterate, of which some are linear in control points over a power of a duration.

    Attributes:
        jacobian: by the unknowns, shape (rows, unknowns).
        values: g, shape (rows,).
        bounds: low and high, each of shape (rows,).
        power: k of each row g = c(points) / T^k, shape (rows,); 0: it is of no such form.
        duration: index of T of each, shape (rows,).
    """

    jacobian: sp.csr_matrix
    values: Array
    bounds: tuple[Array, Array]
    power: Array
    duration: Index

    @property
    def missed(self) -> float:
        """Sum of what the rows are beyond their bounds."""
        low, high = self.bounds
        return float(np.sum(np.maximum(np.maximum(self.values - high, low - self.values), 0)))

    @property
    def equal(self) -> Flags:
        """Which rows are equations, shape (rows,)."""
        return np.asarray(self.bounds[0] == self.bounds[1])

    def only(self, which: Flags) -> Self:
        """Some of the rows."""
        if np.all(which):
            return self
        low, high = (side[which] for side in self.bounds)
        return type(self)(
            self.jacobian[which], self.values[which], (low, high), self.power[which], self.duration[which]
        )

    def below(self, x: Array) -> tuple[sp.csr_matrix, Array, Index]:
        """All finite sides as rows of a step below tops, and of which row each is, the upper sides first.

        c / T^k <= b is c <= b T^k, linear in T where k is 1 and convex else: the tangent of T^k is used, which is
        exact or on the safe side.
        """
        low, high = self.bounds
        rows, top, which = both_sides(self.jacobian, low - self.values, high - self.values)
        # From -k c / T^(k + 1), which the Jacobian has, to -k b / T.
        duration = self.duration[which]
        change = -self.power[which] * top / x[duration]
        return rows + sp.csr_matrix((change, duration, np.arange(top.size + 1)), rows.shape), top, which


@dataclass(frozen=True, eq=False)
class DerivativeRows:
    """Control points of a time derivative over its scales, c(points) / T^order, of all curves of one layout.

    Attributes:
        order: of the derivative.
        linear: c by the unknowns, shape (rows, unknowns); the last entry of every row is a zero at its T.
        duration: index of T of each row, shape (rows,).
    """

    order: int
    linear: sp.csr_matrix
    duration: Index

    @classmethod
    def of(cls, bases: Sequence[Basis], shape: CurveLayout, order: int, scales: Array) -> Self:
        """Rows of all legs: control point by control point, joint by joint.

        Args:
            bases: of the legs.
            shape: of the program.
            order: of the derivative.
            scales: of every joint, shape (joints,).
        """
        columns, values = [], []
        for k, basis in enumerate(bases):
            factors = basis.differences(order)[:, None] / scales[:, None]
            window = np.arange(len(factors))[:, None] + np.arange(order + 1)
            points = shape.points(k)[window].transpose(0, 2, 1)
            columns.append(np.insert(points, order + 1, shape.duration(k), axis=2).reshape(-1, order + 2))
            values.append(np.insert(factors, order + 1, 0.0, axis=2).reshape(-1, order + 2))
        entries, index = np.concatenate(values), np.concatenate(columns)
        starts = np.arange(len(index) + 1) * (order + 2)
        return cls(
            order, sp.csr_matrix((entries.ravel(), index.ravel(), starts), (len(index), shape.size)), index[:, -1]
        )

    def at(self, x: Array, bounds: tuple[Array, Array]) -> Sides:
        """Linearise the rows.

        Args:
            x: unknowns, shape (unknowns,).
            bounds: low and high, each of shape (rows,).
        """
        k, linear, T = self.order, self.linear, x[self.duration]
        c = linear @ x
        entries = linear.data.reshape(c.size, -1) / T[:, None] ** k
        entries[:, -1] = -k * c / T ** (k + 1)
        jacobian = sp.csr_matrix((entries.ravel(), linear.indices, linear.indptr), linear.shape)
        return Sides(jacobian, c / T**k, bounds, np.full(c.size, float(k)), self.duration)
