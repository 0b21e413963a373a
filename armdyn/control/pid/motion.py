"""The equations of motion that a controller closes the loop around, as numbers."""

from typing import Protocol, runtime_checkable

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armdyn.arguments import expect
from armdyn.dynamics import forward_dynamics
from armdyn.models import Robot

Array = NDArray[np.float64]


@runtime_checkable
class EquationsOfMotion(Protocol):
    """D(q) a + C(q, v) v + g(q) = tau, for instance hand-derived ones; all in joint coordinates."""

    def inertia(self, q: Array) -> Array:
        """D(q) [kg m²], shape (nv, nv)."""

    def coriolis(self, q: Array, v: Array) -> Array:
        """C(q, v) [N m s], shape (nv, nv)."""

    def gravity(self, q: Array) -> Array:
        """g(q) [N m], shape (nv,)."""


class Motion(Protocol):
    """What closing the loop and linearising it ask of equations of motion."""

    def inertia(self, q: Array) -> Array:
        """D(q) [kg m²], shape (nv, nv)."""

    def bias(self, q: Array, v: Array) -> Array:
        """C(q, v) v + g(q) + tau_f(v) [N m], shape (nv,), tau_f the joints' friction."""

    def acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        """D⁻¹ (tau - C v - g - tau_f) [rad/s²], shape (nv,)."""

    def stiffness(self, q: Array, tau: Array) -> Array:
        """∂a/∂q [1/s²] at rest under a constant tau, shape (nv, nv)."""

    def drag(self, q: Array) -> Array:
        """∂tau_f/∂v [N m s/rad] at rest, shape (nv,)."""


def motion_of(robot: Robot, dynamics: EquationsOfMotion | None) -> Motion:
    """The robot's own equations by Pinocchio, or the given ones, which have no friction, in their place.

    Raises:
        ProblemError: what is given has not the functions of equations of motion.
    """
    if dynamics is None:
        return PinocchioMotion(robot)
    wanted = "inertia(q), coriolis(q, v) and gravity(q), such as PlanarArm"
    return GivenMotion(expect(dynamics, EquationsOfMotion, "dynamics", wanted))  # type: ignore[type-abstract]


class PinocchioMotion:
    """A robot's equations of motion by Pinocchio's numeric algorithms: microseconds a call."""

    def __init__(self, robot: Robot):
        self._model = robot.model
        self._data = robot.model.createData()
        self._configuration, self._friction = robot.configuration, robot.friction
        self._acceleration = forward_dynamics(robot)

    def inertia(self, q: Array) -> Array:
        """D(q) by the composite-rigid-body algorithm, whose Python binding fills both triangles."""
        return np.array(pin.crba(self._model, self._data, self._configuration(q)))

    def bias(self, q: Array, v: Array) -> Array:
        """C v + g by the recursive Newton-Euler algorithm, and the joints' friction."""
        free = np.array(pin.nonLinearEffects(self._model, self._data, self._configuration(q), v))
        return free + self._friction.torque(v) if self._friction.present else free

    def acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        """By the articulated-body algorithm."""
        return self._acceleration(q, v, tau)

    def stiffness(self, q: Array, tau: Array) -> Array:
        """By Pinocchio's analytic derivatives of the articulated-body algorithm: exact."""
        rest = np.zeros(self._model.nv)
        pin.computeABADerivatives(self._model, self._data, self._configuration(q), rest, tau)
        return np.array(self._data.ddq_dq)

    def drag(self, q: Array) -> Array:
        """Of the joints' friction, smooth as it is."""
        return self._friction.slope(np.zeros(q.size))


_STEP = 1e-3
"""Of the five-point stencil [rad]: its truncation, ~h⁴/30, is then as small as its rounding, ~1e-16/h."""


class GivenMotion:
    """Equations of motion from D, C v and g. D need not be symmetric, so that misprints can be tried, too."""

    def __init__(self, dynamics: EquationsOfMotion):
        self._dynamics = dynamics

    def inertia(self, q: Array) -> Array:
        """D(q), as given."""
        return np.asarray(self._dynamics.inertia(q), dtype=float)

    def bias(self, q: Array, v: Array) -> Array:
        """C v + g, as given."""
        return np.asarray(self._dynamics.coriolis(q, v) @ v + self._dynamics.gravity(q), dtype=float)

    def acceleration(self, q: Array, v: Array, tau: Array) -> Array:
        """By solving with D."""
        return np.asarray(np.linalg.solve(self.inertia(q), tau - self.bias(q, v)), dtype=float)

    def stiffness(self, q: Array, tau: Array) -> Array:
        """By a five-point stencil, good to about 1e-9 of the largest entry."""
        rest = np.zeros(q.size)
        columns = []
        for step in _STEP * np.eye(q.size):
            near, far = (
                self.acceleration(q + k * step, rest, tau) - self.acceleration(q - k * step, rest, tau) for k in (1, 2)
            )
            columns.append((8 * near - far) / (12 * _STEP))
        return np.column_stack(columns)

    def drag(self, q: Array) -> Array:
        """None: what is given has no friction."""
        return np.zeros(q.size)
