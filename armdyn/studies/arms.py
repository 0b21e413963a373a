"""The arms of a study file: robots with the text of their files, and poses as numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from armdyn.arguments import shown
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import positions_of
from armdyn.models.robots.robot import Robot
from armdyn.models.robots.tables import KEYS, robot_from, robot_table
from armdyn.optimal.problem_files import PROBLEM
from armdyn.parsing.toml import Table
from armdyn.studies.problems import POSES, StudyArm

MAX_ARMS = 64
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def arms_of(table: Table, varied: Mapping[str, tuple[str, ...]]) -> Iterator[StudyArm]:
    """The arms that a table [arms] describes.

    Args:
        table: of the study file; robots' files lie in its folder or below.
        varied: names of poses that cases set, of q_start, q_goal or both.

    Raises:
        ProblemError: the table describes none; the message says which line.
    """
    if len(table.values) > MAX_ARMS:
        raise table.error("", f"{len(table.values)} arms; a study has at most {MAX_ARMS}")
    for name in table.values:
        own = table.table(name)
        own.only(("robot", *POSES, *KEYS, *PROBLEM))
        with table.at(name):
            if not _NAME.fullmatch(name):
                raise ProblemError(f"arm {shown(name)}: a name has letters, digits, dots, dashes, 64 at most")
        of_robot = {key: value for key, value in own.values.items() if key in KEYS}
        with own.at("robot" if "robot" in own.values else name):
            given = {"name": own.text("robot", name)} if not {"urdf", "mjcf", "spec"} & of_robot.keys() else {}
            robot = robot_from(Table(own.path, of_robot | given, own.lines, own.within))
            described = robot_table(robot)
        with table.at(name):
            poses = {one: _positions(robot, one, pose) for pose, names in varied.items() for one in names}
        problem = {key: value for key, value in own.values.items() if key in PROBLEM and key not in KEYS}
        if "goal_pose" not in problem or "q_goal" in problem or "q_goal" in varied:
            problem["q_goal"] = _end(own, "q_goal", robot, poses, varied)
        problem["q_start"] = _end(own, "q_start", robot, poses, varied)
        yield StudyArm(name=name, robot=described, problem=problem, poses=poses)


def _end(
    table: Table,
    pose: str,
    robot: Robot,
    poses: Mapping[str, list[float]],
    varied: Mapping[str, tuple[str, ...]],
) -> list[float]:
    """Joint positions [rad or m] at an end of the motion."""
    if pose in varied:
        return list(poses[varied[pose][0]])
    with table.at(pose):
        if pose not in table.values:
            joints = ", ".join(robot.joint_names)
            raise ProblemError(f"{table.called(pose)} is missing: {robot.nv} positions of {joints}, or a pose's name")
        return _positions(robot, table.values[pose], table.called(pose))


def _positions(robot: Robot, given: object, what: str) -> list[float]:
    """Positions of all joints [rad or m].

    Raises:
        ProblemError: they are not.
    """
    values = positions_of(robot, given, what)
    if len(values) != robot.nv:
        raise ProblemError(f"{what} has {len(values)} numbers; {', '.join(robot.joint_names)} need {robot.nv}")
    return [float(value) for value in values]
