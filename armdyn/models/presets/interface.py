"""Command interfaces of controllers: conditions on commanded motions, and their limits."""

from dataclasses import dataclass, fields

import numpy as np

from armdyn.arrays import Array
from armdyn.errors import ProblemError

Numbers = tuple[float, ...]
"""One number per joint."""

UNITS = {
    "position": "rad",
    "velocity": "rad/s",
    "acceleration": "rad/s²",
    "jerk": "rad/s³",
    "torque": "N m",
    "torque_rate": "N m/s",
    "zero_velocity": "rad/s",
    "zero_acceleration": "rad/s²",
}
"""Units of the conditions' values, by the conditions' names; the zero_ conditions hold at both ends of a motion."""

REST_VELOCITY = 1e-3
"""Velocity that counts as rest, allowed wherever a limit is lower [rad/s]: libfranka's own tolerance."""

COMMANDED = ("position", "velocity", "torque")
"""Names of interfaces: the commanded quantity."""


@dataclass(frozen=True)
class Interface:
    """Command interface of a controller.

    Attributes:
        name: the commanded quantity, one of `COMMANDED`.
        rate: commands per second [Hz].
        necessary: names of the conditions whose violation stops the motion.
        recommended: names of the conditions whose violation the controller tolerates, or smooths away.
    """

    name: str
    rate: float
    necessary: tuple[str, ...] = ()
    recommended: tuple[str, ...] = ()

    @property
    def conditions(self) -> tuple[str, ...]:
        """All conditions, the necessary ones first."""
        return self.necessary + self.recommended


@dataclass(frozen=True)
class VelocityTaper:
    """Velocity limits that fall to zero towards the ends of the joints' ranges.

    -max(0, √(gain (q - lower)) - offset) ≤ v ≤ max(0, √(gain (upper - q)) - offset); each one number per joint.

    Attributes:
        lower: position at which the lower limit's root is zero [rad].
        upper: position at which the upper limit's root is zero [rad].
        gain: twice the deceleration of the limits [rad/s²].
        offset: velocity that is taken off the root [rad/s].
    """

    lower: Numbers
    upper: Numbers
    gain: Numbers
    offset: Numbers

    def at(self, q: Array) -> tuple[Array, Array]:
        """Lower and upper velocity limits at joint positions, all of shape (…, nv)."""
        gain, offset = np.asarray(self.gain), np.asarray(self.offset)
        below, above = (np.sqrt(gain * np.maximum(0, room)) for room in (q - self.lower, np.asarray(self.upper) - q))
        return -np.maximum(0, below - offset), np.maximum(0, above - offset)


@dataclass(frozen=True, kw_only=True)
class ControllerLimits:
    """Limits of a controller, each one number per joint; None: none is known.

    Attributes:
        position_lower: [rad].
        position_upper: [rad].
        velocity: [rad/s].
        acceleration: [rad/s²].
        jerk: [rad/s³].
        torque: [N m].
        torque_rate: [N m/s].
        taper: velocity limits that depend on the position, besides `velocity`.
    """

    position_lower: Numbers | None = None
    position_upper: Numbers | None = None
    velocity: Numbers | None = None
    acceleration: Numbers | None = None
    jerk: Numbers | None = None
    torque: Numbers | None = None
    torque_rate: Numbers | None = None
    taper: VelocityTaper | None = None

    def expect(self, condition: str) -> None:
        """Refuse a condition without a limit.

        Raises:
            ProblemError: there is no such condition, or no limit.
        """
        if condition not in UNITS:
            raise ProblemError(f"condition {condition!r} is unknown; there are {', '.join(UNITS)}")
        if condition.startswith("zero_"):
            return
        for name in ("position_lower", "position_upper") if condition == "position" else (condition,):
            if getattr(self, name) is None:
                raise ProblemError(f"condition {condition!r} has no limit: give {name} in [limits]")


LIMITS = tuple(own.name for own in fields(ControllerLimits) if own.name != "taper")
"""Names of the limits."""
