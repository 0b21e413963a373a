"""A program of curves for sequential convexification: torques and velocities by hand, other equations by CasADi."""

from dataclasses import dataclass
from typing import Self

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from armdyn.locks import cached_property
from armdyn.optimal.flat.clearance_rows import ClearanceRows
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.curve_cost import CurveCost
from armdyn.optimal.flat.program import CurveLayout
from armdyn.optimal.flat.torque_rows import TorqueRows
from armdyn.optimal.program.assembly import Program
from armdyn.optimal.solve.solver import NlpData

Array = NDArray[np.float64]
Index = NDArray[np.int_]


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
    def equal(self) -> NDArray[np.bool_]:
        """Which rows are equations, shape (rows,)."""
        return np.asarray(self.bounds[0] == self.bounds[1])

    def only(self, which: NDArray[np.bool_]) -> Self:
        """Some of the rows."""
        if np.all(which):
            return self
        low, high = (side[which] for side in self.bounds)
        return type(self)(
            self.jacobian[which], self.values[which], (low, high), self.power[which], self.duration[which]
        )

    def below(self, x: Array) -> tuple[sp.csr_matrix, Array]:
        """All finite sides as rows of a step below tops, the upper sides first.

        c / T^k <= b is c <= b T^k, linear in T where k is 1 and convex else: the tangent of T^k is used, which is
        exact or on the safe side.
        """
        blocks, tops = [], []
        for sign, bound in zip((1.0, -1.0), self.bounds[::-1], strict=True):
            kept = np.flatnonzero(np.isfinite(bound))
            # From -k c / T^(k + 1), which the Jacobian has, to -k b / T.
            change = self.power[kept] * (self.values[kept] - bound[kept]) / x[self.duration[kept]]
            more = sp.csr_matrix((change, self.duration[kept], np.arange(kept.size + 1)), (kept.size, x.size))
            own = self.jacobian if kept.size == self.values.size else self.jacobian[kept]
            blocks.append(sign * (own + more))
            tops.append(sign * (bound - self.values)[kept])
        return sp.vstack(blocks, format="csr"), np.concatenate(tops)


@dataclass(frozen=True, eq=False)
class CurveProgram:
    """A program of curves in numbers, and the distances that its curve keeps.

    Attributes:
        numbers: unknowns to start from, parameters, bounds.
        shape: where its unknowns and equations stand.
        guess: the curve that the unknowns are of.
        torque_rows: torques and their derivatives.
        cost: what is minimised.
        smooth: price of squared accelerations, which makes steps unique, shape (unknowns, unknowns) [s].
        velocity: scales of the velocities' equations [rad/s or m/s], shape (joints,).
        program: functions of `others`; None: there are none.
        clearance: distances to be kept; None: none.
    """

    numbers: NlpData
    shape: CurveLayout
    guess: Curve
    torque_rows: TorqueRows
    cost: CurveCost
    smooth: sp.csr_matrix
    velocity: Array
    program: Program | None = None
    clearance: ClearanceRows | None = None

    @cached_property
    def torques(self) -> Index:
        """Where the torques stand, shape (points of all legs, joints)."""
        return np.concatenate([self.shape.torques(leg) for leg in self.shape.legs])

    @cached_property
    def place(self) -> NDArray[np.int32]:
        """Order in which unknowns are eliminated: control points, then durations; -1: fixed, or a torque."""
        lower, upper = self.numbers.x_bounds
        free = lower < upper
        free[self.torques] = False
        last = free & np.isin(np.arange(free.size), self.cost.durations)
        order = np.concatenate([np.flatnonzero(free & ~last), np.flatnonzero(last)])
        place = np.full(free.size, -1, dtype=np.int32)
        place[order] = np.arange(order.size)
        return place

    @cached_property
    def rates(self) -> Index:
        """Equations of velocities."""
        return np.concatenate([self.shape.rates(leg, 1).ravel() for leg in self.shape.legs])

    @cached_property
    def others(self) -> Index:
        """Equations other than those of torques and velocities."""
        return other_equations(self.shape, self.numbers.g_bounds[0].size)

    def velocities(self, x: Array) -> Sides:
        """Control points of the velocities over their scales."""
        blocks, duration = [], []
        for k, leg in enumerate(self.guess.legs):
            index, factors, T = self.shape.points(k), leg.basis.factors(1), x[self.shape.duration(k)]
            values = factors[:, None] / (self.velocity * T)
            columns = np.stack([index[:-1], index[1:]], axis=2)
            c = np.diff(x[index], axis=0) * values
            entries = np.stack([-values, values, -c / T], axis=2)
            columns = np.concatenate([columns, np.full((*c.shape, 1), self.shape.duration(k))], axis=2)
            starts = 3 * np.arange(c.size + 1)
            blocks.append((c.ravel(), sp.csr_matrix((entries.ravel(), columns.ravel(), starts), (c.size, x.size))))
            duration.append(np.full(c.size, self.shape.duration(k)))
        values, matrices = zip(*blocks, strict=True)
        which = np.concatenate(duration)
        matrix = matrices[0] if len(matrices) == 1 else sp.vstack(matrices, format="csr")
        low, high = (side[self.rates] for side in self.numbers.g_bounds)
        return Sides(matrix, np.concatenate(values), (low, high), np.ones(which.size), which)

    def other_sides(self, x: Array, load: sp.csr_matrix) -> Sides | None:
        """The other equations, their torques following the unknowns; None: there are none.

        Args:
            x: unknowns, the torques among them.
            load: torques by the unknowns, shape (torques, unknowns).
        """
        if self.program is None:
            return None
        g, matrix = self.program.jacobian(x, self.numbers.p)
        whole = sp.csc_matrix((matrix.nonzeros(), matrix.row(), matrix.colind()), shape=matrix.shape)
        rows, torques = whole.tocsr()[self.others], self.torques.ravel()
        jacobian = (rows + rows[:, torques] @ load).tocsr()
        low, high = (side[self.others] for side in self.numbers.g_bounds)
        return Sides(jacobian, np.array(g).ravel()[self.others], (low, high), *self._powers)

    @cached_property
    def _powers(self) -> tuple[Array, Index]:
        """By which power of its leg's duration each of the others falls, 0: by none; where that duration stands."""
        count = self.numbers.g_bounds[0].size
        power, duration = np.zeros(count), np.full(count, self.cost.durations[0])
        for leg in self.shape.legs:
            for order in self.shape.orders:
                rows = self.shape.rates(leg, order)
                power[rows], duration[rows] = order, self.shape.duration(leg)
        return power[self.others], duration[self.others]


def other_equations(shape: CurveLayout, count: int) -> Index:
    """Indices of the equations other than those of torques and velocities, of so many in all."""
    own = [rows for leg in shape.legs for rows in (shape.torque_rows(leg).ravel(), shape.rates(leg, 1).ravel())]
    return np.setdiff1d(np.arange(count), np.concatenate(own))
