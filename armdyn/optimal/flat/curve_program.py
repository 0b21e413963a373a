"""Program of curves for sequential convexification: torques and velocities by hand, other equations by CasADi."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from armdyn.arrays import Array, Index
from armdyn.locks import cached_property
from armdyn.optimal.flat.clearance_rows import ClearanceRows
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.curve_cost import CurveCost
from armdyn.optimal.flat.derivative_rows import DerivativeRows, Sides
from armdyn.optimal.flat.program import CurveLayout
from armdyn.optimal.flat.torque_rows import TorqueRows
from armdyn.optimal.program.assembly import Program
from armdyn.optimal.solve.solver import NlpData


@dataclass(frozen=True, eq=False)
class CurveProgram:
    """Numbers of a curve program, and the required distances.

    Attributes:
        numbers: initial unknowns, parameters, bounds.
        shape: layout of the unknowns and equations.
        guess: curve of the initial unknowns.
        torque_rows: torques and their derivatives.
        cost: the cost.
        smooth: price of squared accelerations, to make steps unique, shape (unknowns, unknowns) [s].
        velocity_rows: control points of the velocities.
        program: functions of `others`; None: no such equations.
        clearance: required distances; None: no distances.
    """

    numbers: NlpData
    shape: CurveLayout
    guess: Curve
    torque_rows: TorqueRows
    cost: CurveCost
    smooth: sp.csr_matrix
    velocity_rows: DerivativeRows
    program: Program | None = None
    clearance: ClearanceRows | None = None

    @cached_property
    def torques(self) -> Index:
        """Indices of the torques, shape (points of all legs, joints)."""
        return np.concatenate([self.shape.torques(leg) for leg in self.shape.legs])

    @cached_property
    def place(self) -> NDArray[np.int32]:
        """Order of elimination of the unknowns: control points, then durations; -1: fixed, or a torque."""
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
        """Indices of the velocities' equations."""
        return np.concatenate([self.shape.rates(leg, 1).ravel() for leg in self.shape.legs])

    @cached_property
    def others(self) -> Index:
        """Indices of equations other than those of torques and velocities."""
        return other_equations(self.shape, self.numbers.g_bounds[0].size)

    def velocities(self, x: Array) -> Sides:
        """Control points of the velocities over their scales."""
        low, high = (side[self.rates] for side in self.numbers.g_bounds)
        return self.velocity_rows.at(x, (low, high))

    def other_sides(self, x: Array, load: sp.csr_matrix) -> Sides | None:
        """Linearise the other equations, with torques eliminated; None without such equations.

        Args:
            x: unknowns, including the torques.
            load: ∂(torques)/∂(unknowns), shape (torques, unknowns).
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
        """Power of the leg's duration in each other equation's scaling (0: none), and the index of that duration."""
        count = self.numbers.g_bounds[0].size
        power, duration = np.zeros(count), np.full(count, self.cost.durations[0])
        for leg in self.shape.legs:
            for order in self.shape.orders:
                rows = self.shape.rates(leg, order)
                power[rows], duration[rows] = order, self.shape.duration(leg)
        return power[self.others], duration[self.others]


def other_equations(shape: CurveLayout, count: int) -> Index:
    """Indices of the equations that limit neither torques nor velocities, out of `count` equations."""
    own = [rows for leg in shape.legs for rows in (shape.torque_rows(leg).ravel(), shape.rates(leg, 1).ravel())]
    return np.setdiff1d(np.arange(count), np.concatenate(own))
