"""Limits of a curve's time derivatives as linearised rows of their control points."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
import scipy.sparse as sp

from armdyn.arrays import Array, Flags, Index
from armdyn.optimal.flat.basis import Basis
from armdyn.optimal.flat.convex_step import with_values
from armdyn.optimal.flat.program import CurveLayout


@dataclass(frozen=True, eq=False)
class Sides:
    """Rows low <= g <= high at an iterate, some of which are linear in control points over a power of a duration.

    Attributes:
        jacobian: ∂g/∂(unknowns), shape (rows, unknowns).
        values: g, shape (rows,).
        bounds: low and high, each of shape (rows,).
        power: k of each row g = c(points) / T^k, shape (rows,); 0: any other form.
        duration: index of each row's T, shape (rows,).
        closed: whether the last entry of every row of the Jacobian is that of its T.
    """

    jacobian: sp.csr_matrix
    values: Array
    bounds: tuple[Array, Array]
    power: Array
    duration: Index
    closed: bool = False

    @property
    def missed(self) -> float:
        """Sum of the rows' violations."""
        low, high = self.bounds
        return float(np.sum(np.maximum(np.maximum(self.values - high, low - self.values), 0)))

    @property
    def equal(self) -> Flags:
        """Whether each row is an equation, shape (rows,)."""
        return np.asarray(self.bounds[0] == self.bounds[1])

    def only(self, which: Flags) -> Self:
        """The selected rows."""
        if np.all(which):
            return self
        low, high = (side[which] for side in self.bounds)
        own = self.jacobian[which], self.values[which], (low, high), self.power[which], self.duration[which]
        return type(self)(*own, self.closed)

    def below(self, x: Array) -> tuple[tuple[sp.csr_matrix, ...], Array, Index]:
        """One-sided rows of a step, upper sides first, and the index of each one's row.

        c / T^k <= b becomes c <= b T^k, linear in T for k = 1, else convex: the tangent of T^k is exact or
        conservative.
        """
        (low, high), jacobian = self.bounds, self.jacobian
        top = np.concatenate([high - self.values, self.values - low])
        # From -k c / T^(k + 1), which the Jacobian has, to -k b / T.
        changes = np.where(np.isinf(top), 0.0, top).reshape(2, -1) * (-self.power / x[self.duration])
        rows = [with_values(jacobian, sign * jacobian.data) for sign in (1, -1)]
        for k, change in enumerate(changes):
            if self.closed:
                rows[k].data[jacobian.indptr[1:] - 1] += change
            else:
                rows[k] += sp.csr_matrix((change, self.duration, np.arange(change.size + 1)), jacobian.shape)
        return tuple(rows), top, np.tile(np.arange(self.values.size), 2)


@dataclass(frozen=True, eq=False)
class DerivativeRows:
    """Control points of a time derivative over its scales, c(points) / T^order, of all curves of one layout.

    Attributes:
        order: order of the derivative.
        linear: ∂c/∂(unknowns), shape (rows, unknowns); the last entry of every row is a zero at its T.
        duration: index of T of each row, shape (rows,).
    """

    order: int
    linear: sp.csr_matrix
    duration: Index

    @classmethod
    def of(cls, bases: Sequence[Basis], shape: CurveLayout, order: int, scales: Array) -> Self:
        """Rows of all legs, by control point and joint.

        Args:
            bases: bases of the legs.
            shape: layout of the program.
            order: order of the derivative.
            scales: scale of every joint, shape (joints,).
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
        jacobian = with_values(linear, entries.ravel())
        return Sides(jacobian, c / T**k, bounds, np.full(c.size, float(k)), self.duration, closed=True)
