"""Limits of joints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Self

import numpy as np

from armdyn.arguments import Sign, each, expect, numbers, shown, text
from armdyn.arrays import Array, Flags
from armdyn.errors import ArmdynError, SpecError
from armdyn.models.values.actuator_limits import ActuatorLimits, ConstantTorque
from armdyn.models.values.per_joint import JointNumbers, expect_joint, filled, per_joint
from armdyn.reprs import brief

_CONSTANT = ConstantTorque(np.empty(0), np.empty(0))


@brief
@dataclass(frozen=True, kw_only=True)
class JointLimits:
    """Limits of every joint, each of shape (nv,); infinite where there is none.

    Attributes:
        position_lower: [rad or m].
        position_upper: [rad or m].
        velocity: largest speed [rad/s or m/s].
        effort_lower: least torque in any state [N m or N].
        effort_upper: largest torque in any state [N m or N]; both are zero of a joint without a motor.
        actuators: the range of the torques in a state, between these two.

    Raises:
        SpecError: one is not numbers, or NaN, or they are of different shapes.
    """

    position_lower: Array
    position_upper: Array
    velocity: Array
    effort_lower: Array
    effort_upper: Array
    actuators: ActuatorLimits = field(default=_CONSTANT, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name, value in self.rows.items():
            array = numbers(value, f"limits: {name}", "one number per joint", error=SpecError)
            if array.ndim != 1 or array.shape != np.shape(self.position_lower) or np.any(np.isnan(array)):
                raise SpecError(
                    f"limits: {name} is {shown(value)}; expected one number per joint, as many as the others"
                )
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        expect(self.actuators, ActuatorLimits, "limits: actuators", error=SpecError)  # type: ignore[type-abstract]
        object.__setattr__(self, "actuators", self.actuators.between(self.effort_lower, self.effort_upper))

    @property
    def rows(self) -> dict[str, Array]:
        """The limits by their names, each of shape (nv,); without the ranges of the actuators in a state."""
        return {own.name: getattr(self, own.name) for own in fields(self) if own.name != "actuators"}

    @property
    def passive(self) -> Flags:
        """Joints without a motor, shape (nv,)."""
        return self.actuators.passive

    def words(self) -> list[tuple[str, str, str]]:
        """Limits of position, velocity and torque of each joint in words, without units."""
        return [
            (_between(lower, upper), _text(fastest), "no motor" if idle else _between(*effort))
            for lower, upper, fastest, *effort, idle in zip(*self.rows.values(), self.passive, strict=True)
        ]

    def with_effort(
        self, value: JointNumbers, joints: Sequence[str], error: type[ArmdynError], sign: Sign = "any"
    ) -> Self:
        """The limits with other torques either way [N m or N]: one number is of joints with a motor, or see `filled`.

        Raises:
            ArmdynError: as `error`; the value is no such numbers.
        """
        name, unit = "effort_limit", "N m or N"
        given = filled(value, joints, name, self.effort_upper, error)
        upper = per_joint(given, joints, name, unit=unit, error=error, finite=False, sign=sign)
        if given is value and np.ndim(given) == 0:
            upper = np.where(self.passive, 0.0, upper)
        kept = [isinstance(value, Mapping) and name not in value for name in joints]
        return replace(self, effort_lower=np.where(kept, self.effort_lower, -upper), effort_upper=upper)

    def without_motors(self, passive: Iterable[str], joints: Sequence[str], error: type[ArmdynError]) -> Self:
        """The limits with no motor at some joints.

        Args:
            passive: their names.
            joints: the names of all, in the order of the limits.
            error: class of the raised error.

        Raises:
            ArmdynError: as `error`; there is no such joint.
        """
        names = each(passive, "passive", text, error=error)
        for name in names:
            expect_joint(name, joints, "passive", error)
        if not names:
            return self
        motors = np.array([name not in names for name in joints])
        return replace(
            self,
            effort_lower=np.where(motors, self.effort_lower, 0.0),
            effort_upper=np.where(motors, self.effort_upper, 0.0),
        )


def scaled_limits(limits: JointLimits, effort: float | Array, velocity: float | Array) -> JointLimits:
    """Limits with torques, in every state, and velocities times factors [-]: one number, or shape (nv,)."""
    left = limits.actuators.scaled(np.broadcast_to(effort, limits.velocity.shape))
    return replace(
        limits, effort_lower=left.lower, effort_upper=left.upper, actuators=left, velocity=limits.velocity * velocity
    )


def _between(lower: float, upper: float) -> str:
    """A range in words."""
    if -lower == upper:
        return "-" if np.isinf(upper) else f"±{_text(upper)}"
    return f"{_text(lower)} … {_text(upper)}"


def _text(limit: float) -> str:
    return "-" if np.isinf(limit) else f"{limit:.4g}"
