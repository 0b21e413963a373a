"""Torques at points of a curve, linear in its control points and durations."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from armdyn.arrays import Array
from armdyn.dynamics.numeric import inverse_dynamics, inverse_dynamics_derivatives
from armdyn.locks import cached_property
from armdyn.models.robots.robot import Robot
from armdyn.optimal.flat.basis import Basis
from armdyn.optimal.flat.convex_step import with_values
from armdyn.optimal.flat.program import CurveLayout


@dataclass(frozen=True, eq=False)
class TorqueParts:
    """Torques of one curve as parts of half their ranges.

    Attributes:
        rows: rows that evaluated the torques.
        T: durations [s], shape (points of all legs, 1).
        q: positions at the points [rad or m], shape (points of all legs, joints).
        v: velocities [rad/s or m/s], likewise.
        a: accelerations [rad/s² or m/s²], likewise.
        tau: torques, likewise.
        lead: derivatives of the unknowns in the duration, shape (unknowns,); None: zero.
    """

    rows: "TorqueRows"
    T: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    lead: Array | None

    @cached_property
    def jacobian(self) -> csr_matrix:
        """∂(torques)/∂(unknowns), shape (points * joints, unknowns)."""
        return self.rows.jacobian(self)


class TorqueRows:
    """Torques of all curves of one layout on the same bases."""

    def __init__(self, robot: Robot, half_range: Array, legs: Sequence[tuple[Basis, Array]], shape: CurveLayout):
        """Evaluate the splines at the points.

        Args:
            robot: the arm.
            half_range: scales of the torques [N m or N], shape (joints,).
            legs: basis of each leg, and its points as parts of its duration.
            shape: layout of the program.
        """
        self.half_range, n = half_range, robot.nv
        self._torque, self._derivatives = inverse_dynamics(robot), inverse_dynamics_derivatives(robot)
        self._local, self._points = np.concatenate([basis.local(s) for basis, s in legs]), shape.windows(legs)
        self._duration = np.repeat([shape.duration(k) for k in shape.legs], [s.size for _, s in legs])
        columns = np.hstack([self._points.reshape(self._duration.size, -1), self._duration[:, None]])
        index = np.repeat(columns, n, axis=0).astype(np.int32)
        starts = np.arange(len(index) + 1, dtype=np.int32) * index.shape[1]
        self._pattern = csr_matrix((np.zeros(index.size), index.ravel(), starts), (len(index), shape.size))

    def at(self, x: Array, lead: Array | None = None) -> TorqueParts:
        """Torques at unknowns x, whose torque entries are ignored; lead: as in `TorqueParts`."""
        T = x[self._duration][:, None]
        q, dq, ddq = (self._local @ x[self._points]).transpose(1, 0, 2)
        v, a = dq / T, ddq / T**2
        return TorqueParts(self, T, q, v, a, self._torque(q, v, a) / self.half_range, lead)

    def jacobian(self, at: TorqueParts) -> csr_matrix:
        """Linearise torques; see `TorqueParts`."""
        tau, by_q, by_v, inertia = self._derivatives(at.q, at.v, at.a)
        n, wide = tau.shape[1], at.T[..., None]
        local = self._local.transpose(0, 2, 1) / wide ** np.arange(3)
        by_points = local @ np.stack([by_q, by_v, inertia], axis=1).reshape(len(tau), 3, n * n)
        by_duration = -(by_v @ at.v[..., None] + 2 * inertia @ at.a[..., None]) / wide
        columns = [by_points.reshape(len(tau), -1, n, n).transpose(0, 2, 1, 3).reshape(len(tau), n, -1), by_duration]
        values = np.concatenate(columns, axis=2) / self.half_range[:, None]
        matrix = with_values(self._pattern, values.ravel())
        if at.lead is not None:
            matrix.data[matrix.indptr[1:] - 1] += matrix @ at.lead
        return matrix
