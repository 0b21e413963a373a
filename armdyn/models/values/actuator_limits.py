"""Torque limits of an arm's actuators: the range of its torques in a state."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ActuatorLimits(ABC):
    """Range of each joint's torque in a state (q, v).

    A new kind of actuator is a subclass with its own `range`, and fields besides these two.

    Attributes:
        lower: least torque in any state [N m or N], shape (nv,).
        upper: largest torque in any state, likewise; both are zero of a joint without a motor.
        constant: whether the range is the same in all states.
    """

    lower: Array
    upper: Array

    constant: ClassVar[bool] = False

    @abstractmethod
    def range(self, q: Any, v: Any) -> tuple[Any, Any]:
        """Least and largest torque in states [N m or N]: numbers of shape (…, nv), or CasADi expressions.

        Args:
            q: joint positions [rad or m], shape (…, nv), or a CasADi vector.
            v: joint velocities [rad/s or m/s], likewise.
        """

    def clip(self, tau: Array, q: Array, v: Array) -> Array:
        """Torques within their ranges in states, all of shape (…, nv)."""
        return np.asarray(np.clip(tau, *self.range(q, v)))

    def excess(self, tau: Array, q: Array, v: Array) -> Array:
        """How far torques are outside their ranges in states [N m or N], all of shape (…, nv); negative inside."""
        lower, upper = self.range(q, v)
        return np.asarray(np.maximum(tau - upper, lower - tau))

    def allows(self, tau: Array, q: Array, v: Array) -> NDArray[np.bool_]:
        """Whether torques are within their ranges in states, all of shape (…, nv)."""
        lower, upper = self.range(q, v)
        return np.asarray((lower <= tau) & (tau <= upper))

    def extreme(self, sign: Array) -> Array:
        """The upper limit where a sign is positive, the lower where it is negative, else 0; shape (…, nv)."""
        return np.where(sign > 0, self.upper, np.where(sign < 0, self.lower, 0.0))

    @property
    def width(self) -> Array:
        """Largest less least torque [N m or N], shape (nv,)."""
        return self.upper - self.lower

    @property
    def half_range(self) -> Array:
        """Half of `width`."""
        return self.width / 2

    @property
    def center(self) -> Array:
        """Middle of the range [N m or N], shape (nv,)."""
        return (self.upper + self.lower) / 2

    @property
    def strongest(self) -> Array:
        """Largest absolute torque [N m or N], shape (nv,)."""
        return np.asarray(np.maximum(np.abs(self.lower), np.abs(self.upper)))

    @property
    def passive(self) -> NDArray[np.bool_]:
        """Joints without a motor, shape (nv,)."""
        return np.asarray((self.lower == 0) & (self.upper == 0))

    @property
    def scale(self) -> Array:
        """Unit in which torques are compared [N m or N], shape (nv,): the half range.

        Of a joint without a motor it is the least of the other joints' half ranges; 1 where no joint has a motor.
        """
        motors = ~self.passive
        return np.where(motors, self.half_range, np.min(self.half_range[motors]) if np.any(motors) else 1.0)

    def reserving(self, parts: Array) -> Self:
        """The limits less a part of each joint's range [-], shape (nv,)."""
        return replace(self, lower=self.lower * (1 - parts), upper=self.upper * (1 - parts))

    def between(self, lower: Array, upper: Array) -> Self:
        """The same kind of limits with other extreme torques [N m or N], each of shape (nv,)."""
        return replace(self, lower=lower, upper=upper)


@dataclass(frozen=True, eq=False)
class ConstantTorque(ActuatorLimits):
    """Torque limits that are the same in all states."""

    constant: ClassVar[bool] = True

    def range(self, q: Any, v: Any) -> tuple[Array, Array]:
        """`lower` and `upper`, each of shape (nv,)."""
        return self.lower, self.upper
