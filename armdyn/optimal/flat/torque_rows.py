"""Torques at Gauss's points of a curve, linear in its control points and durations."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from armdyn.dynamics.numeric import InverseDerivatives, inverse_dynamics_derivatives
from armdyn.models.robots.robot import Robot
from armdyn.optimal.flat.basis import DEGREE
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.equations import POINTS
from armdyn.optimal.flat.program import CurveLayout

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TorqueParts:
    """Torques of one curve as parts of half their ranges.

    Attributes:
        tau: shape (points of all legs, joints).
        jacobian: by the program's unknowns, shape (points * joints, unknowns).
    """

    tau: Array
    jacobian: csr_matrix


def linear_torques(
    torques: InverseDerivatives, local: Array, points: Array, duration: Array | float
) -> tuple[Array, Array, Array, Array, Array]:
    """Torques at places of a curve, linear in the control points of their windows and in the duration.

    Args:
        torques: inverse dynamics with derivatives.
        local: values and derivatives of the windows' splines, shape (places, 3, WINDOW).
        points: control points of the windows [rad or m], shape (places, WINDOW, nv).
        duration: of the curve [s], or of each place's leg, shape (places, 1).

    Returns:
        Positions, velocities and torques, each of shape (places, nv); derivatives of the torques by the points, shape
        (places, nv, WINDOW, nv), and by the duration, shape (places, nv).
    """
    q, dq, ddq = np.einsum("kdj,kjn->dkn", local, points)
    v, a = dq / duration, ddq / duration**2
    tau, by_q, by_v, inertia = torques(q, v, a)
    basis, T = local[:, :, None, :, None], np.reshape(duration, (-1, 1, 1))
    by_points = basis[:, 0] * by_q[:, :, None] + basis[:, 1] * (by_v / T)[:, :, None]
    by_points += basis[:, 2] * (inertia / T**2)[:, :, None]
    return q, v, tau, by_points, -(by_v @ v[..., None] + 2 * inertia @ a[..., None])[..., 0] / duration


class TorqueRows:
    """Torques of all curves of one layout on the same bases."""

    def __init__(self, robot: Robot, half_range: Array, guess: Curve, shape: CurveLayout):
        """Evaluate the splines.

        Args:
            robot: the arm.
            half_range: scales of the torques [N m or N], shape (joints,).
            guess: a curve with the bases of all legs.
            shape: of the program.
        """
        self.half_range, self.size, n = half_range, shape.size, robot.nv
        self._torques = inverse_dynamics_derivatives(robot)
        places = [leg.basis.gauss(POINTS)[0].ravel() for leg in guess.legs]
        each = list(zip(guess.legs, places, strict=True))
        self._local = np.concatenate([leg.basis.local(s) for leg, s in each])
        firsts = [
            shape.points(k)[leg.basis.interval_of(s)[:, None] + np.arange(DEGREE + 1)]
            for k, (leg, s) in enumerate(each)
        ]
        self._points = np.concatenate(firsts)
        self._duration = np.repeat([shape.duration(k) for k in shape.legs], [s.size for s in places])
        columns = np.hstack([self._points.reshape(self._duration.size, -1), self._duration[:, None]])
        self._columns = np.repeat(columns, n, axis=0).astype(np.int32).ravel()
        self._starts = np.arange(n * self._duration.size + 1, dtype=np.int32) * columns.shape[1]

    def at(self, x: Array) -> TorqueParts:
        """Linearise the torques at unknowns x, shape (unknowns,), of which the torques count for nothing."""
        T = x[self._duration][:, None]
        _, _, tau, by_points, by_duration = linear_torques(self._torques, self._local, x[self._points], T)
        columns = [by_points.reshape(*tau.shape, -1), by_duration[..., None]]
        values = np.concatenate(columns, axis=2) / self.half_range[:, None]
        matrix = csr_matrix((values.ravel(), self._columns, self._starts), (tau.size, self.size), copy=False)
        return TorqueParts(tau / self.half_range, matrix)
