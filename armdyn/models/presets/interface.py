"""Command interfaces of controllers: conditions on commanded motions, and their limits, checked as they are read."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from armdyn.arguments import number, shown, whole
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.per_joint import per_joint
from armdyn.parsing.toml import Table

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
    "end_velocity": "rad/s",
    "time_step": "s",
    "start": "rad",
}
"""Units of the conditions' values, by the conditions' names; the zero_ conditions hold at both ends of a motion."""

OF_ROBOT = ("position_lower", "position_upper", "velocity")
"""Limits that a preset for any arm takes from the robot."""

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
        splines: whether the controller itself goes from point to point by polynomials, in no step with its ticks.
    """

    name: str
    rate: float
    necessary: tuple[str, ...] = ()
    recommended: tuple[str, ...] = ()
    splines: bool = False

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
        end_velocity: largest velocity at the end [rad/s].
        time_step: least time between two points [s].
        start: largest distance of the first point from the present state [rad].
        taper: velocity limits that depend on the position, besides `velocity`.
    """

    position_lower: Numbers | None = None
    position_upper: Numbers | None = None
    velocity: Numbers | None = None
    acceleration: Numbers | None = None
    jerk: Numbers | None = None
    torque: Numbers | None = None
    torque_rate: Numbers | None = None
    end_velocity: Numbers | None = None
    time_step: Numbers | None = None
    start: Numbers | None = None
    taper: VelocityTaper | None = None

    def fitted(self, limits: JointLimits) -> Self:
        """These limits with those `OF_ROBOT` of an arm."""
        own: dict[str, Any] = {name: tuple(getattr(limits, name).tolist()) for name in OF_ROBOT}
        return replace(self, **own)

    def known(self, condition: str) -> bool:
        """Whether a condition on positions or velocities has its limits."""
        return (self.position_lower if condition == "position" else self.velocity) is not None

    def expect(self, condition: str, any_arm: bool = False) -> None:
        """Refuse a condition without a limit; limits `OF_ROBOT` of a preset for any arm may be missing.

        Raises:
            ProblemError: there is no such condition, or no limit.
        """
        if condition not in UNITS:
            raise ProblemError(f"condition {condition!r} is unknown; there are {', '.join(UNITS)}")
        if condition.startswith("zero_"):
            return
        for name in ("position_lower", "position_upper") if condition == "position" else (condition,):
            if getattr(self, name) is None and not (any_arm and name in OF_ROBOT):
                raise ProblemError(f"condition {condition!r} has no limit: give {name} in [limits]")


LIMITS = tuple(own.name for own in fields(ControllerLimits) if own.name != "taper")
"""Names of the limits."""


MOST_JOINTS = 64
"""Most joints of a preset."""
MOST_RATE = 1e5
"""Largest command rate of a controller [Hz]."""

MOST_LETTERS = 1000
"""Most letters of a text in a preset."""

KINDS = ("necessary", "recommended")
ANY = "any"
"""Value of `joints` of a preset for all arms, whose limits are one number for all joints."""
TEXTS = ("name", "robot", "date")
LISTS = ("sources", "not_public")


def _texts_of(table: Table, key: str) -> tuple[str, ...]:
    """A list of texts; empty where it is not given.

    Raises:
        ProblemError: it is something else; the message says in which line, as those of all functions here.
    """
    values = table.values.get(key, [])
    if not isinstance(values, list) or not all(isinstance(one, str) for one in values):
        raise table.error(key, f"{table.called(key)} is {shown(values)}; it must be a list of texts")
    return tuple(_line_of(table, key, one) for one in values)


def _line_of(table: Table, key: str, value: str) -> str:
    """A text that a terminal shows as one line."""
    if not value.isprintable() or len(value) > MOST_LETTERS:
        raise table.error(
            key, f"{table.called(key)} has {shown(value)}; it must be one line of up to {MOST_LETTERS} letters"
        )
    return value


def _joints_of(table: Table) -> tuple[str, ...]:
    """Ends of the joints' names; empty texts where only their number is known; nothing: of any arm."""
    if table.values.get("joints") == ANY:
        return ()
    if isinstance(table.values.get("joints"), list):
        names = _texts_of(table, "joints")
    else:
        with table.at("joints"):
            names = ("",) * whole(table.values.get("joints"), table.called("joints"), 1, MOST_JOINTS)
    if not 1 <= len(names) <= MOST_JOINTS:
        raise table.error("joints", f"{table.called('joints')} has {len(names)} names; expected 1 to {MOST_JOINTS}")
    return names


def _limits_of(table: Table, joints: Sequence[str], key: str, known: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """The rows of a table of limits, one number per joint each."""
    inner = table.table(key)
    inner.only(known)
    names = [name or f"joint {i + 1}" for i, name in enumerate(joints)]
    found = {}
    for name, value in inner.values.items():
        signed = name in ("lower", "upper", "position_lower", "position_upper")
        with inner.at(name):
            row = per_joint(
                value, names, inner.called(name), error=ProblemError, finite=False,
                sign="any" if signed else "not negative" if name == "offset" else "positive",
            )  # fmt: skip
        found[name] = tuple(row.tolist())
    for below, above in (("position_lower", "position_upper"), ("lower", "upper")):
        for joint, low, high in zip(names, found.get(below, ()), found.get(above, ()), strict=False):
            if not low < high:
                raise inner.error(below, f"{below} of joint {joint!r} is {low:g}, {above} {high:g}; it must be below")
    return found


def _taper_of(table: Table, joints: Sequence[str]) -> VelocityTaper | None:
    """Velocity limits that depend on the position; None: none are given."""
    if "velocity_taper" not in table.values:
        return None
    known = ("lower", "upper", "gain", "offset")
    rows = _limits_of(table, joints, "velocity_taper", known)
    if missing := [name for name in known if name not in rows]:
        raise table.error("velocity_taper", f"velocity_taper has no {missing[0]}; it needs {', '.join(known)}")
    return VelocityTaper(**rows)


def _interfaces_of(table: Table, limits: ControllerLimits, any_arm: bool) -> tuple[Interface, ...]:
    """Command interfaces; each of their conditions must have a limit."""
    inner, found = table.table("interfaces"), []
    inner.only(COMMANDED)
    for name in inner.values:
        own = inner.table(name)
        own.only(("rate", "splines", *KINDS))
        if "rate" not in own.values:
            raise own.error("rate", f"{own.called('rate')} is missing: commands per second [Hz]")
        with own.at("rate"):
            rate = number(own.values["rate"], own.called("rate"), unit="Hz", sign="positive", most=MOST_RATE)
        splines, conditions = own.values.get("splines", False), {kind: _texts_of(own, kind) for kind in KINDS}
        if not isinstance(splines, bool):
            raise own.error("splines", f"{own.called('splines')} is {shown(splines)}; it must be true or false")
        for kind, names in conditions.items():
            with own.at(kind):
                for condition in names:
                    limits.expect(condition, any_arm)
        found.append(Interface(name, rate, **conditions, splines=splines))
    return tuple(found)


def preset_fields(table: Table) -> dict[str, Any]:
    """Fields of the `ControllerPreset` that a table describes."""
    table.only((*TEXTS, *LISTS, "joints", "interface", "limits", "velocity_taper", "interfaces"))
    found: dict[str, Any] = {key: _line_of(table, key, table.text(key, "")) for key in (*TEXTS, "interface")}
    if not found["name"]:
        raise table.error("name", f"{table.called('name')} is missing: the preset's name")
    found |= {key: _texts_of(table, key) for key in LISTS}
    joints = _joints_of(table)
    columns = joints or ("",)
    limits = ControllerLimits(**_limits_of(table, columns, "limits", LIMITS), taper=_taper_of(table, columns))
    with table.at("interfaces"):
        return found | {"joints": joints, "limits": limits, "interfaces": _interfaces_of(table, limits, not joints)}
