"""Friction in the joints: viscous, and Coulomb's with its jump made smooth."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import Checked, checked
from armdyn.arrays import Array
from armdyn.models.values.per_joint import JointNumbers, per_joint
from armdyn.reprs import brief

FRICTION_WIDTH = 0.05
"""Default of `JointFriction.width` [rad/s or m/s]: one or two per cent of the speed of industrial joints."""

FrictionValue = JointNumbers | Literal["urdf"]
"""One number, one per joint, or "urdf": that of the URDF's `<dynamics>`."""


def _width(value: ArrayLike, name: str) -> float | Array:
    width = per_joint(value, None, name, unit="rad/s or m/s", sign="positive")
    return width if np.ptp(width) else float(width.flat[0])


@brief
@dataclass(frozen=True, kw_only=True, eq=False)
class JointFriction(Checked):
    """Friction torque of the joints: tau_f(v) = damping v + coulomb tanh(v / width).

    Joint by joint, independent of load and position; the URDF's `<dynamics damping= friction=>`. The
    hyperbolic tangent stands for the sign of the velocity (for instance Armstrong-Hélouvry, Dupont and
    Canudas de Wit, Automatica 30(7), 1994): optimisers and integrators need its slope. It is 0.76 of the jump
    at |v| = width and 0.9999 at 5 widths. At rest it does not stick: a torque below coulomb makes the joint
    creep at less than its `width` times atanh(tau / coulomb).

    Attributes:
        damping: viscous [N m s/rad or N s/m]: one number, or one per joint.
        coulomb: dry friction [N m or N], likewise.
        width: of the smoothed jump [rad/s or m/s], likewise; a float where it is the same in all joints.

    Raises:
        SpecError: negative or not finite; a width of zero.
    """

    damping: ArrayLike = checked(per_joint, 0.0, name="joint friction: damping", joints=None, sign="not negative")
    coulomb: ArrayLike = checked(per_joint, 0.0, name="joint friction: coulomb", joints=None, sign="not negative")
    width: float | Array = checked(_width, FRICTION_WIDTH, name="joint friction: width")

    @property
    def listed_width(self) -> float | list[float]:
        """Width as JSON and TOML have it [rad/s or m/s]: one number, or one per joint."""
        return self.width if isinstance(self.width, float) else self.width.tolist()

    @property
    def present(self) -> bool:
        """Whether some joint has friction."""
        return bool(np.any(self.damping) or np.any(self.coulomb))

    def per_joint(self, nv: int) -> tuple[Array, Array]:
        """Damping [N m s/rad or N s/m] and Coulomb friction [N m or N], each of shape (nv,)."""
        damping, coulomb = (
            np.broadcast_to(np.asarray(own, dtype=float), (nv,)) for own in (self.damping, self.coulomb)
        )
        return damping, coulomb

    def torque(self, v: Array) -> Array:
        """Friction torque [N m or N] at velocities v [rad/s or m/s], both of shape (…, nv)."""
        return np.asarray(np.asarray(self.damping) * v + np.asarray(self.coulomb) * np.tanh(v / self.width))

    def slope(self, v: Array) -> Array:
        """∂tau_f/∂v [N m s/rad or N s/m] at velocities v, both of shape (…, nv)."""
        turning = 1 - np.tanh(v / self.width) ** 2
        return np.asarray(np.asarray(self.damping) + np.asarray(self.coulomb) / self.width * turning, dtype=float)
