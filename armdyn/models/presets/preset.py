"""Controller presets: published limits of robots' controllers, by name or from a TOML file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import each, expect, numbers, one_of, several, shown, text
from armdyn.arrays import Array
from armdyn.errors import ProblemError, TrajectoryError, did_you_mean
from armdyn.files import file_inside
from armdyn.models.presets.check import ControllerCheck, check_points, commands_of, controller_check
from armdyn.models.presets.interface import (
    ANY,
    KINDS,
    LIMITS,
    LISTS,
    TEXTS,
    UNITS,
    ControllerLimits,
    Interface,
    VelocityTaper,
    preset_fields,
)
from armdyn.models.values.joint_limits import JointLimits
from armdyn.parsing.toml import Table, read_toml
from armdyn.reprs import brief
from armdyn.trajectory import Samples, Trajectory
from armdyn.trajectory.planned import Planned

_DATA = Path(__file__).parent / "data"


@brief
@dataclass(frozen=True)
class ControllerPreset:
    """Conditions of a robot's controller on commanded motions, as far as documents make them public.

    Attributes:
        name: name of the preset.
        robot: name of the robot and its controller.
        joints: ends of the joints' names, in their order: joint "joint1" is "panda_joint1", too. Empty texts: any name.
            Nothing: of any arm, whose limits `fitted` fills in.
        limits: limits of the controller.
        interfaces: command interfaces, the default first.
        interface: name of the chosen interface: "position", "velocity" or "torque".
        date: date of the sources.
        sources: documents and files with the numbers.
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
                self.limits.expect(condition, not self.joints)
        names = [one.name for one in self.interfaces]
        object.__setattr__(self, "interface", self.interface or names[0])
        if self.interface not in names:
            raise ProblemError(
                f"preset {self.name!r} has no {shown(self.interface)} interface; it has {', '.join(names)}"
            )

    def _repr_parts(self) -> list[str]:
        joints = f"{len(self.joints) or ANY} joints"
        return [repr(self.name), joints, f"{self.interface} interface at {self.chosen.rate:g} Hz"]

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
        """Read a preset from a TOML file; see docs/presets.md. The file may be untrusted: it is bounded and checked.

        Raises:
            FileError: the file cannot be read, or is too large.
            ProblemError: it describes no preset; the message has the line, and the right form.
        """
        return cls._from(read_toml(path))

    @classmethod
    def _from(cls, table: Table) -> Self:
        with table.at("interfaces"):
            return cls(**preset_fields(table))

    @classmethod
    def from_table(cls, table: Table, key: str) -> Self:
        """Preset of a key in a file: "franka-panda", "franka-panda:torque", a path, or a table.

        Raises:
            ProblemError: the preset is unknown or malformed; the message has the line.
        """
        if isinstance(table.values[key], dict):
            return cls._from(table.table(key))
        with table.at(key):
            name, _, interface = text(table.values[key], key).partition(":")
            if name.lower().endswith(".toml"):
                return cls.read(file_inside(Path(table.path).parent, name)).on(interface)
            return cls.named(name, interface)

    def to_text(self) -> str:
        """The preset's name and interface, "franka-panda:torque", if it is a built-in one; else empty."""
        own = self.name in self.names() and self == type(self).named(self.name, self.interface)
        return f"{self.name}:{self.interface}" if own else ""

    def to_table(self) -> dict[str, Any]:
        """The keys of a TOML file or table that describes the preset."""
        named = all(self.joints)
        limits = {key: list(row) for key in LIMITS if (row := getattr(self.limits, key)) is not None}
        written: dict[str, Any] = {key: getattr(self, key) for key in (*TEXTS, "interface") if getattr(self, key)}
        written |= {key: list(getattr(self, key)) for key in LISTS if getattr(self, key)}
        written |= {"joints": (list(self.joints) if named else len(self.joints)) or ANY, "limits": limits}
        if self.limits.taper is not None:
            written["velocity_taper"] = {key: list(row) for key, row in asdict(self.limits.taper).items()}
        written["interfaces"] = {
            one.name: {"rate": one.rate, "necessary": list(one.necessary), "recommended": list(one.recommended)}
            | ({"splines": True} if one.splines else {})
            for one in self.interfaces
        }
        return written

    @property
    def chosen(self) -> Interface:
        """The chosen interface."""
        return next(one for one in self.interfaces if one.name == self.interface)

    def on(self, interface: str) -> Self:
        """Choose another interface of the preset; empty: the same.

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
            kind: tuple(c for c in getattr(self.chosen, kind) if c not in conditions) for kind in KINDS
        }
        kept = [replace(one, **left) if one.name == self.interface else one for one in self.interfaces]
        return replace(self, interfaces=tuple(kept))

    def fitted(self, limits: JointLimits, joints: Sequence[str]) -> Self:
        """A preset for any arm with the position and velocity limits of one; another preset as it is.

        Args:
            limits: of the arm.
            joints: names of its joints.

        Raises:
            ProblemError: an argument is none of these, or there are not as many names as limits.
        """
        names = each(joints, "joints", text)
        if len(names) != expect(limits, JointLimits, "limits").velocity.size:
            raise ProblemError(f"joints has {len(names)} names; limits are of {limits.velocity.size} joints")
        if self.joints:
            return self
        return replace(self, joints=names, limits=self.limits.fitted(limits))

    def limit(self, name: str) -> Array | None:
        """A limit of the chosen interface, shape (nv,); None: no condition of the interface has it.

        Args:
            name: a field of `ControllerLimits`.

        Raises:
            ProblemError: there is no such limit.
        """
        row = getattr(self.limits, one_of(name, LIMITS, "name"))
        condition = "position" if name.startswith("position") else name
        return np.array(row) if row is not None and condition in self.chosen.conditions else None

    @property
    def taper(self) -> VelocityTaper | None:
        """Velocity limits by position of the chosen interface; None: it has none."""
        return self.limits.taper if "velocity" in self.chosen.conditions else None

    def expect_joints(self, joints: Sequence[str], whose: str = "the robot") -> None:
        """Raise unless a robot's or motion's joints are the preset's.

        Raises:
            ProblemError: another number of joints, or other names.
        """
        names = each(joints, "joints", text)
        if self.joints and len(names) != len(self.joints):
            raise ProblemError(
                f"preset {self.name!r} has {len(self.joints)} joints, but {whose} has {len(names)}: "
                f"{', '.join(names)[:300]}"
            )
        for name, own in zip(names, self.joints, strict=bool(self.joints)):
            if not name.endswith(own):
                raise ProblemError(
                    f"preset {self.name!r} has joints {', '.join(self.joints)[:300]}; {whose} has {shown(name)} in the "
                    f"place of {own!r}"
                )

    def check(
        self,
        motion: Trajectory | Samples | Planned,
        joint_names: Sequence[str] = (),
        present: ArrayLike | None = None,
    ) -> ControllerCheck:
        """Check a motion as the controller sees it: commands at its rate, differentiated backwards.

        Between its points a motion is interpolated as ros2_control's joint_trajectory_controller does: linear if it
        has positions only, cubic with velocities, quintic with accelerations; positions and velocities are checked all
        along. Before and after it the arm rests, or goes on with the velocity that the motion was to have there.

        Args:
            motion: a trajectory, its samples, or another planner's motion as `armdyn.trajectory.planned.read_planned`
                reads it.
            joint_names: names of the motion's joints; by default the trajectory's own, or the preset's.
            present: joint positions of the arm before the motion [rad or m], shape (nv,); None: unknown.

        Raises:
            ProblemError: the motion is of other joints than the preset's.
            TrajectoryError: it has too few points, times do not increase, or it has no torques and the interface takes
                them; or `present` is not one number per joint.
        """
        if not isinstance(motion, Trajectory | Samples | Planned):
            raise TrajectoryError(f"motion is {shown(motion)}; expected a Trajectory")
        check_points(motion)
        count = motion.q.shape[1]
        names = list(several(joint_names, "joint_names") or getattr(motion, "joint_names", ()))
        names = names or [own or f"joint {i + 1}" for i, own in enumerate(self.joints)]
        if len(names) != count:
            names = [f"column {i + 1}" for i in range(count)]
        self.expect_joints(names, "the motion")
        at = None if present is None else numbers(present, "present", error=TrajectoryError)
        if at is not None and at.shape != (count,):
            raise TrajectoryError(f"present has shape {at.shape}; expected one position per joint, ({count},)")
        return controller_check(self.name, self.limits, self.chosen, names, commands_of(motion, self.chosen, at))
