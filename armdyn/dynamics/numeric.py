"""Numeric dynamics by Pinocchio's algorithms in the bridge, with joint friction.

Every function is for one thread: its work space is its own. It lets go of the interpreter's lock. A result is the
caller's own.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.errors import BridgeError
from armdyn.locks import built_once
from armdyn.models.robots.robot import Robot
from armdyn.models.robots.tree import Tree

StateFunction = Callable[[Array, Array, Array], Array]
"""Of q [rad or m], v [rad/s or m/s] and a third, each of shape (…, nv)."""
InverseDerivatives = Callable[[Array, Array, Array], tuple[Array, Array, Array, Array]]
"""(q, v, a) ↦ tau, ∂tau/∂q, ∂tau/∂v, M of states, each argument of shape (…, nv), the joints' friction included."""

_AGREES = 1e-8
"""Largest difference to `pin.aba`, relative to the largest acceleration: light wrists lose eight digits."""


def bridge_arm(robot: Robot) -> Any:
    """The bridge's `Arm` of a robot, see `_bridge/arm.hpp` and `_bridge/motion.hpp`; for one thread.

    Raises:
        UrdfError: its torques are unknown, see `Robot.expect_dynamics`.
        BridgeError: it does not accelerate as `pin.aba` of the robot's model says.
    """
    import _armdyn_bridge as bridge

    return bridge.Arm(**_arguments(robot))


@built_once(maxsize=16)
def _arguments(robot: Robot) -> dict[str, Any]:
    """Constructor arguments of the bridge's `Arm`, whose acceleration equals `pin.aba`."""
    import _armdyn_bridge as bridge

    robot.expect_dynamics()
    friction, n = robot.friction, robot.nv
    lost = (*friction.per_joint(n), np.broadcast_to(friction.width, n)) if friction.present else 3 * (np.empty(0),)
    names = ("damping", "coulomb", "width")
    arguments = Tree.of(robot.model).arguments() | dict(zip(names, map(np.array, lost), strict=True))
    q, v = np.sin(np.arange(1.0, n + 1)), np.cos(np.arange(1.0, n + 1))
    expected = pin.aba(robot.model, robot.model.createData(), robot.configuration(q), v, -friction.torque(v))
    off = np.max(np.abs(bridge.Arm(**arguments).acceleration(q, v, np.zeros(n)) - expected))
    if not off <= _AGREES * np.max(np.abs(expected), initial=1.0):
        raise BridgeError(
            f"armdyn's bridge and pinocchio differ by {off:.1e} rad/s² or m/s² in the motion of {robot.name}"
        )
    return arguments


def forward_dynamics(robot: Robot) -> StateFunction:
    """(q, v, tau) ↦ a: acceleration [rad/s² or m/s²] of torque [N m or N], by `aba` less the joints' friction."""
    acceleration: StateFunction = bridge_arm(robot).acceleration
    return acceleration


def forward_dynamics_derivatives(robot: Robot) -> Callable[[Array, Array, Array], tuple[Array, Array, Array, Array]]:
    """(q, v, tau) ↦ a, ∂a/∂q, ∂a/∂v, M⁻¹ of states, each argument of shape (…, nv), the joints' friction included.

    Pinocchio's derivatives of the articulated-body algorithm: J. Carpentier, N. Mansard, Analytical Derivatives of
    Rigid Body Dynamics Algorithms, RSS 2018.
    """
    derivatives: Callable[[Array, Array, Array], tuple[Array, Array, Array, Array]] = bridge_arm(robot).derivatives
    return derivatives


def joint_inertia(robot: Robot) -> Callable[[Array], Array]:
    """Q, shape (…, nv) ↦ M(q) [kg m², kg m or kg], shape (…, nv, nv), by `crba`."""
    inertia: Callable[[Array], Array] = bridge_arm(robot).inertia
    return inertia


def inverse_dynamics(robot: Robot) -> StateFunction:
    """(q, v, a) ↦ tau: torque [N m or N] of acceleration [rad/s² or m/s²], by `rnea` and the joints' friction."""
    torque: StateFunction = bridge_arm(robot).torque
    return torque


def inverse_dynamics_derivatives(robot: Robot) -> InverseDerivatives:
    """Inverse dynamics of states with derivatives, from those of forward dynamics: ∂tau/∂x = -M ∂a/∂x."""
    arm = bridge_arm(robot)

    def derivatives(q: Array, v: Array, a: Array) -> tuple[Array, Array, Array, Array]:
        tau, inertia = arm.torque(q, v, a), arm.inertia(q)
        _, by_q, by_v, _ = arm.derivatives(q, v, tau)
        return tau, -inertia @ by_q, -inertia @ by_v, inertia

    return derivatives
