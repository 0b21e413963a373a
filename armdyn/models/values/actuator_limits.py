"""Torque limits of an arm's actuators: the range of its torques in a state."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import expect, numbers, shown
from armdyn.arrays import Array, Flags
from armdyn.errors import SpecError
from armdyn.locks import cached_property
from armdyn.models.values.per_joint import expect_joint

_CONCAVE = 1e-9
"""Relative rounding of a curve's torques and slopes, which were typed with ten digits."""


@dataclass(frozen=True, eq=False)
class ActuatorLimits(ABC):
    """Range of each joint's torque in a state (q, v).

    A new kind of actuator is a subclass with its own `range` and `lines`, and fields besides these two.

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

    @property
    def lines(self) -> tuple[Array, Array]:
        """Slopes s [N m s/rad or N s/m] and torques c at rest [N m or N] of |τ + s v| ≤ c, each of shape (k, nv).

        With `lower` and `upper` they are the range, as the programs of minimum time have it.

        Raises:
            SpecError: the range is no such set.
        """
        if not self.constant:
            raise SpecError(f"{type(self).__name__} has no lines |tau + s v| <= c; minimum time needs them")
        return np.empty((0, self.lower.size)), np.empty((0, self.lower.size))

    def clip(self, tau: Array, q: Array, v: Array) -> Array:
        """Torques within their ranges in states, all of shape (…, nv)."""
        return np.asarray(np.clip(tau, *self.range(q, v)))

    def excess(self, tau: Array, q: Array, v: Array) -> Array:
        """Excess of torques over their ranges in states [N m or N], all of shape (…, nv); negative inside."""
        lower, upper = self.range(q, v)
        return np.asarray(np.maximum(tau - upper, lower - tau))

    def allows(self, tau: Array, q: Array, v: Array) -> Flags:
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
    def passive(self) -> Flags:
        """Joints without a motor, shape (nv,)."""
        return np.asarray((self.lower == 0) & (self.upper == 0))

    @cached_property
    def scale(self) -> Array:
        """Unit in which torques are compared [N m or N], shape (nv,): the half range.

        Of a joint without a motor it is the least of the other joints' half ranges; 1 where no joint has a motor.
        """
        motors = ~self.passive
        return np.where(motors, self.half_range, np.min(self.half_range[motors]) if np.any(motors) else 1.0)

    def scaled(self, factors: Array) -> Self:
        """The limits with the torques of each joint times a factor [-], shape (nv,)."""
        return replace(self, lower=self.lower * factors, upper=self.upper * factors)

    def between(self, lower: Array, upper: Array) -> Self:
        """Limits of the same kind with other extreme torques [N m or N], each of shape (nv,)."""
        return replace(self, lower=lower, upper=upper)


@dataclass(frozen=True, eq=False)
class ConstantTorque(ActuatorLimits):
    """Torque limits that are the same in all states."""

    constant: ClassVar[bool] = True

    def range(self, q: Any, v: Any) -> tuple[Array, Array]:
        """`lower` and `upper`, each of shape (nv,)."""
        return self.lower, self.upper


@dataclass(frozen=True, eq=False)
class TorqueSpeed(ActuatorLimits):
    """Torque limits that fall with speed: a driving joint keeps its torque-speed curve, a braking one may use all.

    The curve is concave and piecewise linear, t(|v|) = min_k (c_k - s_k |v|) with s_k ≥ 0, and |τ + s_k v| ≤ c_k in all
    four quadrants, besides `lower` and `upper`. So is a motor at limited voltage and current: its back EMF, which grows
    with speed, leaves less torque to drive, and helps to brake. Beyond its last point the curve is extrapolated.

    Attributes:
        joints: names of all joints.
        curves: by the names of joints, points (speed [rad/s or m/s], torque [N m or N]), shape (points, 2); the limits
            of other joints are the same at all speeds.

    Raises:
        SpecError: there is no such joint; or a curve does not begin at speed 0 with a positive torque, its speeds do
            not grow, its torque rises with speed, or it is not concave.
    """

    joints: tuple[str, ...]
    curves: Mapping[str, ArrayLike]

    def __post_init__(self) -> None:
        right = "joint name to [speed, torque] points"
        given = expect(self.curves, Mapping, "torque_speed", right, error=SpecError)  # type: ignore[type-abstract]
        for name in given:
            expect_joint(name, self.joints, "torque_speed")
        curves = {name: _checked(name, points) for name, points in given.items()}
        object.__setattr__(self, "curves", curves)

    @cached_property
    def lines(self) -> tuple[Array, Array]:
        """See `ActuatorLimits.lines`; a joint with fewer lines than others has some of infinite torque."""
        joints = zip(self.joints, self.strongest * (1 - _CONCAVE), strict=True)
        own = [
            _lines(np.asarray(self.curves[name]), most) if name in self.curves and most else np.empty((0, 2))
            for name, most in joints
        ]
        count = max((len(each) for each in own), default=0)
        padded = [np.vstack([each, np.tile([0.0, np.inf], (count - len(each), 1))]) for each in own]
        slopes, rest = np.moveaxis(np.array(padded).reshape(len(own), count, 2), 2, 0)
        return slopes.T, rest.T

    def range(self, q: Any, v: Any) -> tuple[Any, Any]:
        """Least and largest torque in states [N m or N]; past the curve's last speed they only brake."""
        symbolic = isinstance(v, ca.SX | ca.MX)
        least, most, number = (ca.fmin, ca.fmax, ca.DM) if symbolic else (np.minimum, np.maximum, np.asarray)
        weakest, strongest = number(self.lower), number(self.upper)
        lower, upper = weakest, strongest
        for slope, rest in zip(*map(list, self.lines), strict=True):
            fallen = number(slope) * v
            lower, upper = most(lower, -number(rest) - fallen), least(upper, number(rest) - fallen)
        return least(lower, strongest), most(upper, weakest)

    def scaled(self, factors: Array) -> Self:
        each = dict(zip(self.joints, factors, strict=True))
        curves = {name: np.asarray(points) * [1.0, each[name]] for name, points in self.curves.items()}
        return replace(super().scaled(factors), curves=curves)


def torque_speed_entry(limits: ActuatorLimits) -> dict[str, list[list[float]]]:
    """The torque-speed curves of limits as lists, by the names of joints; empty: there are none."""
    curves = limits.curves if isinstance(limits, TorqueSpeed) else {}
    return {name: np.asarray(points).tolist() for name, points in curves.items()}


def _lines(points: Array, most: float) -> Array:
    """Slopes s and torques c at rest of the lines t = c - s v through neighbouring points, shape (lines, 2).

    Without level ones at the largest torque, which repeat the torque limits.
    """
    speed, torque = points.T
    slopes = -np.diff(torque) / np.diff(speed)
    lines = np.stack([slopes, torque[:-1] + slopes * speed[:-1]], axis=1)
    return np.compress((slopes > 0) | (torque[:-1] < most), lines, axis=0)


def _checked(joint: str, given: ArrayLike) -> Array:
    """The points of a joint's curve, shape (points, 2)."""
    what = f"torque_speed of joint {joint!r}"
    points = numbers(given, what, "[speed, torque] of two or more points", error=SpecError)
    if wrong := _wrong_with(points):
        raise SpecError(
            f"{what} is {shown(points.tolist())}: {wrong}; expected [speed, torque] of two or more points, speeds "
            "growing from 0, and torques that fall evenly or ever faster (a concave curve)"
        )
    points.setflags(write=False)
    return points


def _wrong_with(points: Array) -> str:
    """Fault of a curve's points, in words; empty: none."""
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 2:
        return f"its shape is {points.shape}"
    if not np.all(np.isfinite(points)):
        return "a number is not finite"
    speed, torque = points.T
    if speed[0] != 0 or np.any(np.diff(speed) <= 0):
        return "its speeds do not grow from 0"
    if torque[0] <= 0 or torque[-1] < 0:
        return f"its torque is {torque[0] if torque[0] <= 0 else torque[-1]:g} N m or N"
    slopes = np.diff(torque) / np.diff(speed)
    if np.any(slopes > 0):
        return f"its torque rises beyond speed {speed[np.argmax(slopes > 0)]:g}"
    bends = np.diff(slopes) > _CONCAVE * np.max(np.abs(slopes))
    return (
        f"it is not concave: it falls more slowly beyond speed {speed[1 + np.argmax(bends)]:g}" if np.any(bends) else ""
    )
