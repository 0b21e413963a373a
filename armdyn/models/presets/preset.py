"""Controller presets: published limits of robots' controllers, by name or from a TOML file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import number, one_of, several, shown, text, whole
from armdyn.errors import ProblemError, TrajectoryError, did_you_mean
from armdyn.models.presets.check import ControllerCheck, controller_check
from armdyn.models.presets.commands import check_points
from armdyn.models.presets.interface import COMMANDED, LIMITS, UNITS, ControllerLimits, Interface, VelocityTaper
from armdyn.models.values.per_joint import per_joint
from armdyn.parsing.toml import Table, read_toml
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory
from armdyn.trajectory.planned import Planned

Array = NDArray[np.float64]

MOST_JOINTS = 64
"""Joints that a preset may have."""
MOST_RATE = 1e5
"""Commands per second that a controller may take [Hz]."""

MOST_LETTERS = 1000
"""Letters of a text of a preset."""

_DATA = Path(__file__).parent / "data"
_TEXTS = ("name", "robot", "date")
_LISTS = ("sources", "not_public")


@brief
@dataclass(frozen=True)
class ControllerPreset:
    """Conditions of a robot's controller on commanded motions, as far as documents make them public.

    Attributes:
        name: of the preset.
        robot: the robot and its controller.
        joints: ends of the joints' names, in their order: joint "joint1" is "panda_joint1", too. Empty texts: any name.
        limits: of the controller.
        interfaces: command interfaces, the default first.
        interface: name of the interface whose conditions hold: "position", "velocity" or "torque".
        date: of the sources.
        sources: documents and files that the numbers are from.
        not_public: conditions and limits that no public document gives.
    """

    name: str
    robot: str
    joints: tuple[str, ...]
    limits: ControllerLimits
    interfaces: tuple[Interface, ...]
    interface: str = ""
    date: str = ""
    sources: tuple[str, ...] = ()
    not_public: tuple[str, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        if not self.interfaces:
            raise ProblemError(f"preset {self.name!r} has no interface: give [interfaces.position]")
        for one in self.interfaces:
            for condition in one.conditions:
                self.limits.expect(condition)
        names = [one.name for one in self.interfaces]
        object.__setattr__(self, "interface", self.interface or names[0])
        if self.interface not in names:
            raise ProblemError(
                f"preset {self.name!r} has no {shown(self.interface)} interface; it has {', '.join(names)}"
            )

    def _words(self) -> list[str]:
        return [repr(self.name), f"{len(self.joints)} joints", f"{self.interface} interface at {self.chosen.rate:g} Hz"]

    @classmethod
    def names(cls) -> tuple[str, ...]:
        """Names of the built-in presets."""
        return tuple(sorted(file.stem for file in _DATA.glob("*.toml")))

    @classmethod
    def named(cls, name: str, interface: str = "") -> Self:
        """A built-in preset.

        Args:
            name: one of `names`.
            interface: "position", "velocity" or "torque"; empty: the preset's default.

        Raises:
            ProblemError: there is no such preset, or no such interface.
        """
        known = cls.names()
        if text(name, "name of a preset") not in known:
            meant = did_you_mean(name, known) or f"; known: {', '.join(known)}"
            raise ProblemError(f"there is no controller preset named {shown(name)}{meant}")
        return cls.read(_DATA / f"{name}.toml").on(interface)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> Self:
        """A preset of a TOML file; docs/presets.md says how. The file may be a stranger's: it is bounded and checked.

        Raises:
            FileError: the file cannot be read, or is too large.
            ProblemError: it describes no preset; the message says in which line, and what would be right.
        """
        return cls._from(read_toml(path))

    @classmethod
    def _from(cls, table: Table) -> Self:
        table.only((*_TEXTS, *_LISTS, "joints", "interface", "limits", "velocity_taper", "interfaces"))
        texts: dict[str, Any] = {key: _line(table, key, table.text(key, "")) for key in (*_TEXTS, "interface")}
        if not texts["name"]:
            raise table.error("name", f"{table.called('name')} is missing: the preset's name")
        lists: dict[str, Any] = {key: _texts(table, key) for key in _LISTS}
        joints = _joints(table)
        limits = ControllerLimits(**_limits(table, joints, "limits", LIMITS), taper=_taper(table, joints))
        with table.at("interfaces"):
            return cls(joints=joints, limits=limits, interfaces=_interfaces(table, limits), **texts, **lists)

    def to_table(self) -> dict[str, Any]:
        """The keys of a TOML file that describes the preset."""
        named = all(self.joints)
        limits = {key: list(row) for key in LIMITS if (row := getattr(self.limits, key)) is not None}
        written: dict[str, Any] = {key: getattr(self, key) for key in (*_TEXTS, "interface") if getattr(self, key)}
        written |= {key: list(getattr(self, key)) for key in _LISTS if getattr(self, key)}
        written |= {"joints": list(self.joints) if named else len(self.joints), "limits": limits}
        if self.limits.taper is not None:
            written["velocity_taper"] = {key: list(row) for key, row in asdict(self.limits.taper).items()}
        written["interfaces"] = {
            one.name: {"rate": one.rate, "necessary": list(one.necessary), "recommended": list(one.recommended)}
            for one in self.interfaces
        }
        return written

    @property
    def chosen(self) -> Interface:
        """The interface whose conditions hold."""
        return next(one for one in self.interfaces if one.name == self.interface)

    def on(self, interface: str) -> Self:
        """The preset with the conditions of another interface; empty: of the same.

        Raises:
            ProblemError: the preset has no such interface.
        """
        return replace(self, interface=text(interface, "interface") or self.interface)

    def without(self, *conditions: str) -> Self:
        """The preset with some conditions of its chosen interface left out.

        Raises:
            ProblemError: there is no such condition.
        """
        for condition in conditions:
            one_of(condition, tuple(UNITS), "condition")
        left: dict[str, Any] = {
            kind: tuple(c for c in getattr(self.chosen, kind) if c not in conditions) for kind in _KINDS
        }
        kept = [replace(one, **left) if one.name == self.interface else one for one in self.interfaces]
        return replace(self, interfaces=tuple(kept))

    def limit(self, name: str) -> Array | None:
        """A limit that holds on the chosen interface, shape (nv,); None: no condition asks for it.

        Args:
            name: of a field of `ControllerLimits`.

        Raises:
            ProblemError: there is no such limit.
        """
        row = getattr(self.limits, one_of(name, LIMITS, "name"))
        condition = "position" if name.startswith("position") else name
        return np.array(row) if row is not None and condition in self.chosen.conditions else None

    @property
    def taper(self) -> VelocityTaper | None:
        """Velocity limits that depend on the position, if they hold on the chosen interface."""
        return self.limits.taper if "velocity" in self.chosen.conditions else None

    def expect_joints(self, joints: Sequence[str], whose: str = "the robot") -> None:
        """Refuse a robot or a motion of other joints.

        Raises:
            ProblemError: another number of joints, or other names.
        """
        names = [text(name, "joints") for name in several(joints, "joints")]
        if len(names) != len(self.joints):
            raise ProblemError(
                f"preset {self.name!r} has {len(self.joints)} joints, but {whose} has {len(names)}: "
                f"{', '.join(names)[:300]}"
            )
        for name, own in zip(names, self.joints, strict=True):
            if not name.endswith(own):
                raise ProblemError(
                    f"preset {self.name!r} has joints {', '.join(self.joints)[:300]}; {whose} has {shown(name)} in the "
                    f"place of {own!r}"
                )

    def check(self, motion: Trajectory | Planned, joint_names: Sequence[str] = ()) -> ControllerCheck:
        """Check a motion as the controller sees it: commands at its rate, differentiated backwards.

        Between its points a motion is interpolated as ros2_control's joint_trajectory_controller does: linear if it
        has positions only, cubic with velocities, quintic with accelerations. The arm rests before and after it.

        Args:
            motion: a trajectory, or another planner's motion as `armdyn.trajectory.planned.read_planned` reads it.
            joint_names: names of the motion's joints; by default the trajectory's own, or the preset's.

        Raises:
            ProblemError: the motion is of other joints than the preset's.
            TrajectoryError: it has too few points, times do not increase, or it has no torques and the interface takes
                them.
        """
        if not isinstance(motion, Trajectory | Planned):
            raise TrajectoryError(f"motion is {shown(motion)}; expected a Trajectory")
        check_points(motion)
        count = motion.q.shape[1]
        names = list(several(joint_names, "joint_names") or getattr(motion, "joint_names", ()))
        names = names or [own or f"joint {i + 1}" for i, own in enumerate(self.joints)]
        if len(names) != count:
            names = [f"column {i + 1}" for i in range(count)]
        self.expect_joints(names, "the motion")
        return controller_check(self.name, self.limits, self.chosen, names, motion)


_KINDS = ("necessary", "recommended")


def _texts(table: Table, key: str) -> tuple[str, ...]:
    values = table.values.get(key, [])
    if not isinstance(values, list) or not all(isinstance(one, str) for one in values):
        raise table.error(key, f"{table.called(key)} is {shown(values)}; it must be a list of texts")
    return tuple(_line(table, key, one) for one in values)


def _line(table: Table, key: str, value: str) -> str:
    """A text that a terminal shows as one line."""
    if not value.isprintable() or len(value) > MOST_LETTERS:
        raise table.error(
            key, f"{table.called(key)} has {shown(value)}; it must be one line of up to {MOST_LETTERS} letters"
        )
    return value


def _joints(table: Table) -> tuple[str, ...]:
    """Ends of the joints' names; empty texts where only their number is known."""
    if isinstance(table.values.get("joints"), list):
        names = _texts(table, "joints")
    else:
        with table.at("joints"):
            names = ("",) * whole(table.values.get("joints"), table.called("joints"), 1, MOST_JOINTS)
    if not 1 <= len(names) <= MOST_JOINTS:
        raise table.error("joints", f"{table.called('joints')} has {len(names)} names; expected 1 to {MOST_JOINTS}")
    return names


def _limits(table: Table, joints: Sequence[str], key: str, known: Sequence[str]) -> dict[str, tuple[float, ...]]:
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


def _taper(table: Table, joints: Sequence[str]) -> VelocityTaper | None:
    if "velocity_taper" not in table.values:
        return None
    known = ("lower", "upper", "gain", "offset")
    rows = _limits(table, joints, "velocity_taper", known)
    if missing := [name for name in known if name not in rows]:
        raise table.error("velocity_taper", f"velocity_taper has no {missing[0]}; it needs {', '.join(known)}")
    return VelocityTaper(**rows)


def _interfaces(table: Table, limits: ControllerLimits) -> tuple[Interface, ...]:
    inner, found = table.table("interfaces"), []
    inner.only(COMMANDED)
    for name in inner.values:
        own = inner.table(name)
        own.only(("rate", *_KINDS))
        with own.at("rate"):
            rate = number(own.values.get("rate"), own.called("rate"), unit="Hz", sign="positive")
            if rate > MOST_RATE:
                raise ProblemError(f"{own.called('rate')} is {rate:g} Hz; it must be at most {MOST_RATE:g}")
        conditions = {}
        for kind in _KINDS:
            conditions[kind] = _texts(own, kind)
            for condition in conditions[kind]:
                with own.at(kind):
                    limits.expect(condition)
        found.append(Interface(name, rate, **conditions))
    return tuple(found)
