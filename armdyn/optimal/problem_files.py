"""Problem files: minimum-time problems in TOML, with the names of the Python arguments; docs/problem_files.md."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from armdyn.arguments import shown
from armdyn.files import file_inside
from armdyn.models.presets.preset import ControllerPreset
from armdyn.models.robots.poses import positions_of
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.obstacles import obstacle_from
from armdyn.models.scene.reaching import GoalPose
from armdyn.models.scene.scenes import load_scene
from armdyn.models.tables import robot_from
from armdyn.models.values.placement import pose_of
from armdyn.optimal.constraints.constraint import PathConstraint
from armdyn.optimal.constraints.regions import FrameRegion
from armdyn.optimal.constraints.registry import path_constraint_from
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.parsing.toml import Table, read_toml

TABLES = ("robot", "problem", "options")
OPTIONS = ("method", "search", "starts", "time_limit", "max_intervals", "seed", "calm")
PROBLEM = tuple(field.name for field in fields(MinimumTimeProblem) if field.init and field.name != "robot")
"""Keys of [problem]; those of [robot] are `models.tables.KEYS`."""
GOAL_POSE = ("frame", "position", "quaternion", "rpy", "free", "tolerance")
"""Keys of a goal pose."""

_KINDS = {
    "arms": "a study file, whose cases armdyn sweep {} does",
    "problem": "a problem file, which armdyn mintime {} solves",
    "cycle": "a cycle file, which armdyn cycle {} solves",
    "steps": "a cycle file, which armdyn cycle {} solves",
}
"""Kinds of files by tables that only they have."""
_WORDS = {
    "start": "q_start",
    "goal": "q_goal",
    "via": "via",
    "goal pose": "goal_pose",
    "obstacle": "obstacles",
    "--limit": "path_constraints",
}
"""Words in messages, and the key that each concerns."""


@dataclass(frozen=True, eq=False)
class ProblemFile:
    """A problem file as plain values, from which robot and problem are made.

    Attributes:
        robot: the table [robot].
        problem: the table [problem].
        options: options of the solver, by the names of `MinimumTimeOptions`.
    """

    robot: Table
    problem: Table
    options: Mapping[str, Any]

    def new_robot(self, mass: float | None = None) -> Robot:
        """Make the robot, with another payload mass [kg]; None: the file's.

        Raises:
            ProblemError: the table is invalid; the message has the line.
        """
        return robot_from(self.robot, mass)

    def new_problem(self, mass: float | None = None) -> MinimumTimeProblem:
        """Make the problem, with another payload mass [kg]; None: the file's.

        Raises:
            ProblemError: the tables are invalid; the message has the line.
        """
        return problem_from(self.problem, self.new_robot(mass))


def read_problem(path: str | os.PathLike[str]) -> MinimumTimeProblem:
    """Read a problem file; docs/problem_files.md. `MinimumTimeProblem.to_toml` writes one.

    The file is untrusted: its size is limited, its robot is a name or a file inside its own folder, and nothing is
    downloaded.

    Args:
        path: path of a TOML file.

    Raises:
        FileError: the file cannot be read, or is too large.
        ProblemError: the file is invalid; the message has the line and a correction.
    """
    return read_problem_file(path).new_problem()


def read_problem_file(path: str | os.PathLike[str]) -> ProblemFile:
    """Read the tables of a problem file; keys and options are checked, robot and problem are not made.

    Raises:
        FileError: the file cannot be read, or is too large.
        ProblemError: the file is no TOML, or has an unknown table; the message has the line.
    """
    file = read_toml(path)
    only_tables(file, TABLES)
    options = file.table("options")
    options.only(OPTIONS)
    with options.locating_errors():
        MinimumTimeOptions(**options.values)
    return ProblemFile(file.table("robot"), file.table("problem"), options.values)


def problem_from(table: Table, robot: Robot) -> MinimumTimeProblem:
    """Make the problem of a table [problem].

    Raises:
        ProblemError: a key is unknown or wrong; the message has the line.
    """
    table.only((*PROBLEM, "scene"))
    with table.locating_errors(_WORDS):
        return MinimumTimeProblem(robot, **_arguments(table, robot))


def _arguments(table: Table, robot: Robot) -> dict[str, Any]:
    """Arguments of `MinimumTimeProblem`."""
    given = conditions_from(table, robot)
    for key in ("q_start", "q_goal"):
        if key in given:
            given[key] = positions_of(robot, given[key], key)
    if "q_start" not in given:
        raise table.error("", f"[problem] has no q_start: {robot.nv} positions of {', '.join(robot.joint_names)}")
    if "via" in given:
        given["via"] = via_from(table, robot)
    if "goal_pose" in given:
        given["goal_pose"] = goal_pose_from(table.table("goal_pose"), robot)
    return given


def only_tables(file: Table, own: Sequence[str]) -> None:
    """Raise for unknown tables; for a file of another kind the message names its command.

    Args:
        file: whole.
        own: its tables.

    Raises:
        ProblemError: it has another one; the message has the line.
    """
    for key, kind in _KINDS.items():
        if key in file.values and key not in own:
            raise file.error(key, f"[{key}] is of {kind.format(file.path)}")
    file.only(own)


def conditions_from(table: Table, robot: Robot) -> dict[str, Any]:
    """Convert a table's conditions of a motion to arguments of `MinimumTimeProblem`.

    Obstacles, scene, path constraints, preset and torque limits are converted; other values stay as they are.

    Raises:
        ProblemError: a value is wrong; the message has the line.
    """
    given, folder = dict(table.values), Path(table.path).parent
    if "preset" in given:
        given["preset"] = ControllerPreset.from_table(table, "preset")
    if "obstacles" in given:
        entries = _listed(table, "obstacles")
        given["obstacles"] = [obstacle_from(one, f"obstacle {i}", folder) for i, one in enumerate(entries, start=1)]
    if "scene" in given:
        with table.at("scene"):
            scene = load_scene(file_inside(folder, given.pop("scene")), robot)
        given["obstacles"] = [*given.get("obstacles", ()), *scene.obstacles]
        given["allowed_contacts"] = [*given.get("allowed_contacts", ()), *scene.allowed_contacts]
    if "path_constraints" in given:
        given["path_constraints"] = [
            _constraint_from(table, one, robot, f"path_constraints[{i}]")
            for i, one in enumerate(_listed(table, "path_constraints"))
        ]
    limit = given.get("effort_limit")
    if isinstance(limit, list) and len(limit) == 2 and all(isinstance(end, list) for end in limit):
        given["effort_limit"] = tuple(limit)  # (lower, upper)
    return given


def _constraint_from(table: Table, entry: object, robot: Robot, name: str) -> PathConstraint:
    """The path constraint of a text, as for --limit, or of a table with a region and perhaps a leg."""
    if isinstance(entry, str):
        return path_constraint_from(entry)
    if not isinstance(entry, Mapping) or not isinstance(entry.get("region"), Mapping):
        raise table.error(
            "path_constraints",
            f"{name} is {shown(entry)}; give texts such as 'tip-speed=0.25', or tables with a region",
        )
    own = replace(table, values=entry, within=(*table.within, "path_constraints"))
    own.only(("region", "leg"))
    return FrameRegion(goal_pose_from(replace(own, values=entry["region"]), robot, f"{name}.region"), entry.get("leg"))


def via_from(table: Table, robot: Robot) -> list[list[float] | GoalPose]:
    """The via points of a table: joint positions, and goal poses or regions.

    Raises:
        ProblemError: they are no list, or one of them is wrong.
    """
    listed = enumerate(_listed(table, "via"))
    return [place_from(replace(table, values={"via": one}), "via", robot, f"via[{i}]") for i, one in listed]


def place_from(table: Table, key: str, robot: Robot, name: str = "") -> list[float] | GoalPose:
    """Joint positions [rad or m] by a key of a table, or a goal pose or region.

    Args:
        table: table with the key.
        key: of the place.
        robot: the arm.
        name: name of a goal pose in messages; empty: the key.

    Raises:
        ProblemError: they are wrong.
    """
    if isinstance(table.values[key], Mapping):
        return goal_pose_from(table.table(key), robot, name or key)
    return positions_of(robot, table.values[key], key)


def goal_pose_from(table: Table, robot: Robot, name: str = "goal_pose") -> GoalPose:
    """The goal pose or region of a table.

    Raises:
        ProblemError: a key is unknown or wrong.
    """
    table.only(GOAL_POSE)
    given = table.values
    at, quaternion, rpy = (given.get(key) for key in ("position", "quaternion", "rpy"))
    at = () if at is None else at
    placed = at if quaternion is None and rpy is None else pose_of(at, quaternion, rpy, name)
    region = {key: given.get(key, ()) for key in ("free", "tolerance")}
    return GoalPose(given.get("frame", robot.tip), placed, **region)


def _listed(table: Table, key: str) -> list[Any]:
    value = table.values[key]
    if not isinstance(value, list):
        raise table.error(key, f"{key} is {shown(value)}; it must be a list")
    return value
