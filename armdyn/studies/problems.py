"""Problems of cases: an arm as the tables [robot] and [problem] of a problem file, changed by the case's settings."""

import copy
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol

from armdyn.arguments import expect
from armdyn.errors import ProblemError, did_you_mean, reraised
from armdyn.files import file_inside
from armdyn.models.presets.preset import ControllerPreset
from armdyn.models.robots.poses import positions_of
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.obstacles import obstacle_entry, obstacle_from
from armdyn.models.scene.scenes import load_scene
from armdyn.models.tables import robot_from
from armdyn.models.values.joint_limits import scaled_limits
from armdyn.optimal import MinimumTimeProblem
from armdyn.optimal.problem_files import PROBLEM, problem_from
from armdyn.parsing.toml import Table
from armdyn.studies.rows import Value

ARM = "arm"
"""Setting that names the arm."""
POSES = ("q_start", "q_goal")
PLANT = "plant_"
"""Prefix of the settings of the arm that moves, where it is not the controller's model."""
OF_ROBOT = ("payload", "effort_limit", "effort_scale", "velocity_limit", "velocity_scale", "damping", "friction")
"""Settings of the robot; all others are keys of [problem], or settings of a task."""


class ProblemSource(Protocol):
    """Problems of cases by their settings."""

    def problem(self, settings: Mapping[str, Value]) -> MinimumTimeProblem:
        """Problem of a case."""

    def description(self) -> Mapping[str, object]:
        """All that the problems depend on, as JSON."""


@dataclass(frozen=True, kw_only=True)
class StudyArm:
    """An arm of a study, which is sent to workers: no file is needed there.

    Attributes:
        name: in the study.
        robot: the table [robot], with the text of its file.
        problem: the table [problem], with positions as numbers.
        poses: positions of the poses that cases set by their names.
    """

    name: str
    robot: Mapping[str, Any]
    problem: Mapping[str, Any]
    poses: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def description(self) -> dict[str, object]:
        """The arm as JSON; the text of a file by its checksum."""
        named = {"named": {name: list(q) for name, q in sorted(self.poses.items())}} if self.poses else {}
        return {"robot": with_checksum(self.robot), "problem": dict(self.problem), **named}


@dataclass(frozen=True, kw_only=True)
class ArmProblems:
    """Problems of a study's arms.

    Attributes:
        arms: at least one.
        fixed: settings of all cases.
    """

    arms: tuple[StudyArm, ...]
    fixed: Mapping[str, Value] = field(default_factory=dict)

    def with_fixed(self, settings: Mapping[str, Value]) -> dict[str, Value]:
        """The fixed settings of all cases, and those of a case; where a setting is in both, the case's."""
        return {**self.fixed, **settings}

    def arm(self, settings: Mapping[str, Value]) -> StudyArm:
        """The arm of a case."""
        name = self.with_fixed(settings).get(ARM)
        return next(arm for arm in self.arms if arm.name == (name or arm.name))

    def robot(self, settings: Mapping[str, Value]) -> Robot:
        """The robot with a case's payload, limits and friction.

        Raises:
            ArmdynError: a setting does not fit it.
        """
        given = self.with_fixed(settings)
        robot = _plain_robot(json.dumps(dict(self.arm(settings).robot)), given.get("payload"))
        robot = robot.with_limits(given.get("effort_limit"), given.get("velocity_limit"))
        scales = (given.get(name, 1.0) for name in ("effort_scale", "velocity_scale"))
        robot = replace(robot, limits=scaled_limits(robot.limits, *scales))
        return robot.with_friction(given.get("damping"), given.get("friction"), None)

    def plant(self, settings: Mapping[str, Value]) -> Robot:
        """The simulated robot: the controller's model, changed by the settings plant_…."""
        given = self.with_fixed(settings)
        return self.robot(given | {name.removeprefix(PLANT): given[name] for name in given if name.startswith(PLANT)})

    def table(self, settings: Mapping[str, Value]) -> Table:
        """The table [problem] of a case.

        Raises:
            ProblemError: a setting leads to a place that the table does not have.
        """
        arm, given = self.arm(settings), self.with_fixed(settings)
        values = copy.deepcopy(dict(arm.problem))
        joints = _plain_robot(json.dumps(dict(arm.robot)), None).joint_names
        for name, value in sorted(given.items(), key=lambda one: one[0].count(".")):
            if name.partition(".")[0] in PROBLEM and name not in OF_ROBOT:
                place, key = place_of(values, name, joints)
                place[key] = list(arm.poses[value]) if name in POSES and isinstance(value, str) else value
        return Table(arm.name, values, None)

    def ends(self, settings: Mapping[str, Value]) -> tuple[list[float], list[float]]:
        """Joint positions [rad or m] at start and goal."""
        values, robot = self.table(settings).values, self.robot(settings)
        start, goal = (list(positions_of(robot, values[pose], pose)) for pose in POSES)
        return start, goal

    def problem(self, settings: Mapping[str, Value]) -> MinimumTimeProblem:
        """Problem of a case.

        Raises:
            ArmdynError: its settings do not fit the arm.
        """
        return problem_from(self.table(settings), self.robot(settings))

    def key(self, settings: Mapping[str, Value]) -> str:
        """Text that identifies a problem: equal for equal problems, also those of other studies in this process."""
        robot = {name: value for name, value in self.with_fixed(settings).items() if name in OF_ROBOT}
        return json.dumps([dict(self.arm(settings).robot), robot, self.table(settings).values], sort_keys=True)

    def description(self) -> dict[str, object]:
        """All that the problems depend on, as JSON."""
        return {"arms": {arm.name: arm.description() for arm in self.arms}, "fixed": dict(sorted(self.fixed.items()))}


@lru_cache(maxsize=16)
def _plain_robot(table: str, payload: float | None) -> Robot:
    """The robot of a table [robot] in JSON, with another mass of its payload [kg]; None: its own."""
    values = json.loads(table)
    return robot_from(Table(str(values.get("name", "robot")), values, None), payload)


def without_files(table: Table) -> Table:
    """A file's table with the obstacles and presets that it names as files, so that rows depend on it alone.

    Raises:
        ProblemError: a file is not inside the folder of the table's, or cannot be read.
    """
    with reraised(ProblemError, table.path):
        return replace(table, values=_read(table.values, "", table.path))


def _read(given: Any, key: str, path: str) -> Any:
    """A value of a key with the contents of its files, which lie in the folder of a file."""
    if isinstance(given, list):
        return [_read(one, key, path) for one in given]
    if isinstance(given, Mapping):
        if {"type", "file"} <= given.keys():
            return obstacle_entry(obstacle_from(given, key, Path(path).parent))
        return {name: _read(one, name, path) for name, one in given.items()}
    if key == "preset" and isinstance(given, str) and ".toml" in given.lower():
        return ControllerPreset.from_table(Table(path, {key: given}, None), key).to_table()
    return given


def with_scene(values: Mapping[str, Any], table: Table, robot: Robot) -> dict[str, Any]:
    """Conditions with the obstacles and the allowed contacts of their scene instead of its name.

    Args:
        values: conditions of a motion.
        table: that they are from.
        robot: the arm.

    Raises:
        ArmdynError: the scene cannot be read; the message has the line.
    """
    found = dict(values)
    if "scene" not in found:
        return found
    with table.at("scene"):
        scene = load_scene(file_inside(Path(table.path).parent, found.pop("scene")), robot)
    for name, more in (
        ("obstacles", map(obstacle_entry, scene.obstacles)),
        ("allowed_contacts", map(list, scene.allowed_contacts)),
    ):
        with table.at(name):
            found[name] = [*expect(found.get(name, []), list, name), *more]
    return found


def with_checksum(robot: Mapping[str, Any]) -> dict[str, Any]:
    """A table [robot] with the SHA-256 of its URDF or MJCF in place of the text."""
    texts = {key: robot[key] for key in ("urdf", "mjcf") if key in robot}
    return {**robot, **{key: hashlib.sha256(text.encode()).hexdigest() for key, text in texts.items()}}


def place_of(values: Any, name: str, joints: Sequence[str]) -> tuple[Any, Any]:
    """Container of a setting, and its key in it.

    The way goes through keys of tables, and through lists by numbers from 0, by the names of joints, or by the names
    of members; of a cycle's moves by theirs.

    Raises:
        ProblemError: there is no such place.
    """
    steps, place = name.split("."), values
    for i, step in enumerate(steps):
        found: Any = step
        if isinstance(place, list):
            members = [one.get("name", one.get("move")) if isinstance(one, dict) else None for one in place]
            names = list(joints) if len(place) == len(joints) and not any(members) else members
            found = names.index(step) if step in names else int(step) if step.isdecimal() else len(place)
            if found >= len(place):
                known = [str(one) for one in names if one] or [f"0 to {len(place) - 1}"]
                meant = did_you_mean(step, known) or f"; there are {', '.join(known)}"
                raise ProblemError(f"{name}: {'.'.join(steps[:i])} has no {step!r}{meant}")
        if i == len(steps) - 1:
            return place, found
        if isinstance(place, dict) and found not in place:
            raise ProblemError(f"{name}: {'.'.join(steps[: i + 1])} is not there to be changed")
        place = place[found]
        if not isinstance(place, dict | list):
            raise ProblemError(f"{name}: {'.'.join(steps[: i + 1])} is {place!r}, neither a table nor a list")
    raise ProblemError(f"{name} is no setting")
