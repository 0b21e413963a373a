"""Settings of cases, and the robots and problems that they make."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Literal, Protocol

from armdyn.arguments import Sign, number, shown
from armdyn.errors import ProblemError, did_you_mean
from armdyn.models.robots.poses import position_of
from armdyn.models.robots.robot import Robot
from armdyn.models.values.spec import ArmSpec, Payload
from armdyn.optimal import MinimumTimeProblem
from armdyn.studies.rows import Value

Source = Literal["planar", "library", "urdf", "mjcf"]

ARM = "arm"
"""The setting that says which arm it is."""
POSES = ("q_start", "q_goal")
PLANT = "plant_"
"""Settings of the arm that moves begin so."""
_OF_PROBLEM = ("reserve", "velocity_reserve", "acceleration_limit")

SIGNS: dict[str, Sign] = {
    "payload": "not negative", "effort_limit": "positive", "effort_scale": "positive", "velocity_limit": "positive",
    "velocity_scale": "positive", "reserve": "not negative", "velocity_reserve": "not negative",
    "damping": "not negative", "friction": "not negative",
}  # fmt: skip
"""Settings that every task has, and what their numbers must be."""

UNITS = {
    "payload": "kg", "effort_limit": "N m", "velocity_limit": "rad/s", "damping": "N m s/rad", "friction": "N m",
    "acceleration_limit": "rad/s²", "q_start": "rad", "q_goal": "rad", "kp": "N m/rad", "ki": "N m/(rad s)",
    "kd": "N m s/rad", "bandwidth": "rad/s", "ramp": "s", "rate": "Hz", "delay": "ticks", "position": "rad",
    "velocity": "s", "integral": "1/s", "cutoff": "Hz", "noise": "rad", "plant_payload": "kg",
    "plant_damping": "N m s/rad", "plant_friction": "N m",
}  # fmt: skip
"""Of the settings that have one."""
OUTCOMES = {
    "duration_s": "minimum time [s]", "torque_squared": "∫ τᵀτ dt [(N m)² s]", "settled_time_s": "settled time [s]",
    "peak_error": "largest error on the way [rad]", "ms_saved_by_one_per_cent": "saved by 1 % of a limit [ms]",
}  # fmt: skip
"""What the axes of figures say of facts."""


@dataclass(frozen=True, kw_only=True)
class ArmRecipe:
    """An arm and its poses, as they are sent to whoever works: no file is needed there.

    Attributes:
        name: what the study calls it.
        source: what the text is.
        text: the name of a planar or a library's arm, or a whole URDF or MJCF.
        q_start: joint positions at the start [rad or m].
        q_goal: at the end.
        named: poses that cases set by their names, each likewise.
    """

    name: str
    source: Source
    text: str
    q_start: tuple[float, ...]
    q_goal: tuple[float, ...]
    named: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def robot(self, payload: float = 0.0) -> Robot:
        """The arm with a point mass [kg] at its tip.

        Raises:
            ArmdynError: there is no such arm, or it cannot carry that.
        """
        carried = Payload(mass=payload) if payload else None
        if self.source == "planar":
            return Robot.from_spec(ArmSpec.paper(self.text), carried)  # type: ignore[arg-type]  # it checks
        if self.source == "library":
            return Robot.from_library(self.text, carried)
        if self.source == "mjcf":
            return Robot.from_mjcf_string(self.text, carried, source=self.name)
        return Robot.from_urdf_string(self.text, carried, source=self.name)

    def fitted(self, settings: Mapping[str, Value]) -> Robot:
        """The arm with a case's payload, limits and friction.

        Raises:
            ArmdynError: a setting does not fit it.
        """
        robot = self.robot(_number(settings, "payload") or 0.0)
        robot = robot.with_limits(_number(settings, "effort_limit"), _number(settings, "velocity_limit"))
        if (scale := _number(settings, "effort_scale")) is not None:
            robot = robot.with_limits(scale * robot.limits.actuators.strongest, None)
        if (scale := _number(settings, "velocity_scale")) is not None:
            robot = robot.with_limits(None, scale * robot.limits.velocity)
        return robot.with_friction(_number(settings, "damping"), _number(settings, "friction"), None)

    def poses(self, settings: Mapping[str, Value], joints: Sequence[str]) -> dict[str, Any]:
        """Start and goal [rad or m], with the pose or the joints' positions that a case sets."""
        found = {}
        for pose in POSES:
            q = list(self.named[str(settings[pose])] if pose in settings else getattr(self, pose))
            for i, joint in enumerate(joints):
                q[i] = _number(settings, f"{pose}.{joint}", q[i])
            found[pose] = q
        return found

    def description(self) -> dict[str, object]:
        """As JSON says it; a file by its checksum."""
        text = self.text
        if self.source in ("urdf", "mjcf"):
            text = hashlib.sha256(text.encode()).hexdigest()
        poses = {"q_start": list(self.q_start), "q_goal": list(self.q_goal)}
        named = {"named": {name: list(q) for name, q in sorted(self.named.items())}} if self.named else {}
        return {"source": self.source, "robot": text, **poses, **named}


def unit_of(name: str) -> str:
    """A setting's unit; empty: it has none."""
    return UNITS.get(name.partition(".")[0], "")


def label(name: str) -> str:
    """A column as the axes of figures say it, with its unit."""
    unit = unit_of(name)
    return OUTCOMES.get(name) or (f"{name} [{unit}]" if unit else f"{name} [-]")


class ProblemSource(Protocol):
    """Problems of cases by their settings."""

    def problem(self, settings: Mapping[str, Value]) -> MinimumTimeProblem:
        """Problem of a case."""

    def description(self) -> Mapping[str, object]:
        """All that the problems depend on, as JSON."""


@dataclass(frozen=True, kw_only=True)
class ArmProblems:
    """Problems of a study's arms.

    Attributes:
        arms: at least one.
        fixed: settings of all cases.
    """

    arms: tuple[ArmRecipe, ...]
    fixed: Mapping[str, Value] = field(default_factory=dict)

    def settings(self, own: Mapping[str, Value]) -> dict[str, Value]:
        """The settings of a case with the fixed ones."""
        return {**self.fixed, **own}

    def arm(self, own: Mapping[str, Value]) -> ArmRecipe:
        """The arm of a case."""
        name = self.settings(own).get(ARM)
        return next(arm for arm in self.arms if arm.name == (name or arm.name))

    def robot(self, own: Mapping[str, Value]) -> Robot:
        """The arm with a case's payload, limits and friction.

        Raises:
            ArmdynError: a setting does not fit it.
        """
        return self.arm(own).fitted(self.settings(own))

    def plant(self, own: Mapping[str, Value]) -> Robot:
        """The arm that moves: the controller's model, but for the settings plant_…."""
        own = self.settings(own)
        named = {name.removeprefix(PLANT): value for name, value in own.items() if name.startswith(PLANT)}
        return self.robot({**own, **named})

    def ends(self, own: Mapping[str, Value]) -> tuple[list[float], list[float]]:
        """Joint positions [rad or m] at start and goal."""
        poses = self.arm(own).poses(self.settings(own), self.robot(own).joint_names)
        return poses["q_start"], poses["q_goal"]

    def problem(self, settings: Mapping[str, Value]) -> MinimumTimeProblem:
        """Problem of a case.

        Raises:
            ArmdynError: its settings do not fit the arm.
        """
        own, (start, goal) = self.settings(settings), self.ends(settings)
        kept = {name: _number(own, name) for name in _OF_PROBLEM if name in own}
        return MinimumTimeProblem(self.robot(settings), q_start=start, q_goal=goal, **kept)

    def key(self, own: Mapping[str, Value]) -> str:
        """Problems of one key are the same, also of another study in the same process."""
        arm = self.arm(own)
        return json.dumps([arm.source, arm.text, self.ends(own), sorted(self.settings(own).items())])

    def description(self) -> dict[str, object]:
        """All that the problems depend on, as JSON."""
        return {"arms": {arm.name: arm.description() for arm in self.arms}, "fixed": dict(sorted(self.fixed.items()))}


def check_setting(name: str, value: object, signs: Mapping[str, Sign], arms: Sequence[ArmRecipe]) -> Value:
    """A setting's value, if there is such a setting.

    Args:
        name: of it.
        value: as given.
        signs: of the settings that the task has.
        arms: of the study.

    Raises:
        ProblemError: there is no such setting, or it cannot have that value.
    """
    if name == ARM:
        names = [arm.name for arm in arms]
        if isinstance(value, str) and value in names:
            return value
        raise ProblemError(f"arm is {shown(value)}; the study's arms are {', '.join(names)}")
    pose, dot, joint = name.partition(".")
    if pose in POSES:
        return _position(name, joint, value, arms) if dot else _pose(name, value, arms)
    if name not in signs:
        known = (ARM, *POSES, *(f"{pose}.JOINT" for pose in POSES), *signs)
        meant = did_you_mean(name, known) or f"; settings: {', '.join(known)}"
        raise ProblemError(f"{name} is no setting{meant}")
    found = number(value, name, unit=UNITS.get(name, ""), sign=signs[name])
    if name in ("reserve", "velocity_reserve") and found >= 1:
        raise ProblemError(f"{name} is {found:g}; it is a part of the limits, from 0 to below 1")
    return found


def _pose(name: str, value: object, arms: Sequence[ArmRecipe]) -> str:
    """The name of a pose that all arms have."""
    if isinstance(value, str) and all(value in arm.named for arm in arms):
        return value
    raise ProblemError(f"{name} is {shown(value)}; write names of poses, or {name}.JOINT with positions")


def _position(name: str, joint: str, value: object, arms: Sequence[ArmRecipe]) -> float:
    """A position [rad or m] of a joint that all arms have: a number, or a text such as "90deg"."""
    found = 0.0
    for arm in arms:
        slides = _slides(arm.source, arm.text)
        if joint not in slides:
            meant = did_you_mean(joint, slides) or f"; its joints: {', '.join(slides)}"
            raise ProblemError(f"{name}: arm {arm.name} has no joint {joint!r}{meant}")
        found = number(position_of(value, name, slides[joint]), name)
    return found


@lru_cache(maxsize=64)
def _slides(source: Source, text: str) -> dict[str, bool]:
    """Which joints of an arm slide, by their names; once for all values of a study."""
    robot = ArmRecipe(name="arm", source=source, text=text, q_start=(), q_goal=()).robot()
    return dict(zip(robot.joint_names, robot.slides.tolist(), strict=True))


def _number(settings: Mapping[str, Value], name: str, default: Any = None) -> Any:
    value = settings.get(name, default)
    return default if value is None else float(value)
