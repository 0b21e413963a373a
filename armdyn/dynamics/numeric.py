"""Numeric dynamics by Pinocchio, with joint friction."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.models.reading.urdf_arm import configurations
from armdyn.models.robots.robot import Robot

StateFunction = Callable[[Array, Array, Array], Array]
"""Of q [rad or m], v [rad/s or m/s] and a third, each of shape (nv,)."""
InverseDerivatives = Callable[[Array, Array, Array], tuple[Array, Array, Array, Array]]
"""(q, v, a) ↦ tau, ∂tau/∂q, ∂tau/∂v, M of many states, each argument of shape (k, nv)."""


def forward_dynamics(robot: Robot) -> StateFunction:
    """(q, v, tau) ↦ a: acceleration [rad/s² or m/s²] of torque [N m or N], by `pin.aba` less the joints' friction.

    For one thread: Pinocchio's work space belongs to the function. A result is the caller's own.
    """
    model, data, friction = robot.model, robot.model.createData(), robot.friction
    configuration = configurations(model)

    def free(q: Array, v: Array, tau: Array) -> Array:
        return np.array(pin.aba(model, data, configuration(q), v, tau))

    def rubbing(q: Array, v: Array, tau: Array) -> Array:
        return free(q, v, tau - friction.torque(v))

    return rubbing if friction.present else free


def forward_dynamics_derivatives(robot: Robot) -> Callable[[Array, Array, Array], tuple[Array, Array, Array, Array]]:
    """(q, v, tau) ↦ a, ∂a/∂q, ∂a/∂v, M⁻¹ of many states, each argument of shape (k, nv), the joints' friction included.

    Pinocchio's derivatives of the articulated-body algorithm: J. Carpentier, N. Mansard, Analytical Derivatives of
    Rigid Body Dynamics Algorithms, RSS 2018. For one thread, like `forward_dynamics`.
    """
    model, data, friction = robot.model, robot.model.createData(), robot.friction
    configuration = configurations(model)

    def derivatives(q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array, Array]:
        a, (by_q, by_v, inverse) = np.empty_like(v), np.empty((3, *v.shape, v.shape[-1]))
        free = tau - friction.torque(v) if friction.present else tau
        for k in range(len(v)):
            pin.computeABADerivatives(model, data, configuration(q[k]), v[k], free[k])
            a[k], by_q[k], by_v[k], inverse[k] = data.ddq, data.ddq_dq, data.ddq_dv, data.Minv
        inverse = np.triu(inverse) + np.triu(inverse, 1).swapaxes(1, 2)
        if friction.present:
            by_v -= inverse * friction.slope(v)[:, None]
        return a, by_q, by_v, inverse

    return derivatives


def joint_inertia(robot: Robot) -> Callable[[Array], Array]:
    """Q ↦ M(q) [kg m², kg m or kg], shape (nv, nv), by `pin.crba`, which fills but the upper half.

    For one thread, like `forward_dynamics`.
    """
    model, data, configuration = robot.model, robot.model.createData(), configurations(robot.model)
    lower = np.tril_indices(robot.nv, -1)

    def inertia(q: Array) -> Array:
        matrix: Array = np.array(pin.crba(model, data, configuration(q)))
        matrix[lower] = matrix.T[lower]
        return matrix

    return inertia


def inverse_dynamics(robot: Robot) -> StateFunction:
    """(q, v, a) ↦ tau: torque [N m or N] of acceleration [rad/s² or m/s²], by `pin.rnea` and the joints' friction.

    For one thread, like `forward_dynamics`.
    """
    model, data, friction = robot.model, robot.model.createData(), robot.friction
    configuration = configurations(model)

    def free(q: Array, v: Array, a: Array) -> Array:
        return np.array(pin.rnea(model, data, configuration(q), v, a))

    def rubbing(q: Array, v: Array, a: Array) -> Array:
        return free(q, v, a) + friction.torque(v)

    return rubbing if friction.present else free


def inverse_dynamics_derivatives(robot: Robot) -> InverseDerivatives:
    """(q, v, a) ↦ tau, ∂tau/∂q, ∂tau/∂v, M of many states, each argument of shape (k, nv), the joints' friction included.

    Pinocchio's derivatives of the recursive Newton-Euler algorithm: Carpentier and Mansard, as of
    `forward_dynamics_derivatives`. For one thread, like `forward_dynamics`.
    """
    model, data, friction = robot.model, robot.model.createData(), robot.friction
    configuration, lower, diagonal = configurations(model), np.tril_indices(robot.nv, -1), np.arange(robot.nv)

    def derivatives(q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array]:
        tau, (by_q, by_v, inertia) = np.empty_like(v), np.empty((3, *v.shape, v.shape[-1]))
        for k in range(len(v)):
            pin.computeRNEADerivatives(model, data, configuration(q[k]), v[k], a[k])
            tau[k], by_q[k], by_v[k], inertia[k] = data.tau, data.dtau_dq, data.dtau_dv, data.M
        inertia[:, lower[0], lower[1]] = inertia[:, lower[1], lower[0]]
        if friction.present:
            tau += friction.torque(v)
            by_v[:, diagonal, diagonal] += friction.slope(v)
        return tau, by_q, by_v, inertia

    return derivatives
