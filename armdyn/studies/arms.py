"""The arms of a study file: robots that need no file any more, and their poses as numbers."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from armdyn.arguments import shown
from armdyn.errors import ProblemError
from armdyn.files import read_bounded
from armdyn.models import PLANAR_ARMS
from armdyn.models.mjcf.document import is_mjcf
from armdyn.models.robots.poses import positions_of
from armdyn.models.robots.robot import Robot
from armdyn.parsing.toml import Table
from armdyn.studies.settings import POSES, ArmRecipe, Source

MAX_ARMS = 64
MAX_ROBOT = 2**22
"""Of a study's own URDF or MJCF [bytes]: it is sent with the cases."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


def arms_of(table: Table, folder: Path, varied: Mapping[str, tuple[str, ...]]) -> Iterator[ArmRecipe]:
    """The arms that a table [arms] says.

    Args:
        table: it.
        folder: of the study, in which robots' files lie.
        varied: names of poses that cases set, of q_start, q_goal or both.

    Raises:
        ProblemError: one is none; the message says which line.
    """
    if len(table.values) > MAX_ARMS:
        raise table.error("", f"{len(table.values)} arms; a study has at most {MAX_ARMS}")
    for name in table.values:
        own = table.table(name)
        own.only(("robot", *POSES))
        with table.at(name):
            if not _NAME.fullmatch(name):
                raise ProblemError(f"arm {shown(name)}: a name has letters, digits, dots, dashes, 64 at most")
        with own.at("robot" if "robot" in own.values else name):
            source, text, place = _source(own.text("robot", name), folder)
            bare = ArmRecipe(name=name, source=source, text=text, q_start=(), q_goal=()).robot()
        by_name = varied or any(isinstance(own.values.get(pose), str) for pose in POSES)
        robot = _as_in_its_file(place) if place and by_name else bare
        with table.at(name):
            named = {one: _positions(robot, one, pose) for pose, names in varied.items() for one in names}
        start, goal = (named[varied[pose][0]] if pose in varied else _pose(own, pose, robot) for pose in POSES)
        yield ArmRecipe(name=name, source=source, text=text, q_start=start, q_goal=goal, named=named)


def _as_in_its_file(place: Path) -> Robot:
    """A robot that knows where its file is, and so the poses of an SRDF by it."""
    return Robot.from_mjcf(place) if is_mjcf(place) else Robot.from_urdf(place)


def _pose(table: Table, pose: str, robot: Robot) -> tuple[float, ...]:
    with table.at(pose):
        if pose not in table.values:
            joints = ", ".join(robot.joint_names)
            raise ProblemError(f"{table.called(pose)} is missing: {robot.nv} positions of {joints}, or a pose's name")
        return _positions(robot, table.values[pose], table.called(pose))


def _positions(robot: Robot, given: object, what: str) -> tuple[float, ...]:
    """Positions of all joints [rad or m].

    Raises:
        ProblemError: they are not.
    """
    values = positions_of(robot, given, what)
    if len(values) != robot.nv:
        raise ProblemError(f"{what} has {len(values)} numbers; {', '.join(robot.joint_names)} need {robot.nv}")
    return tuple(values)


def _source(robot: str, folder: Path) -> tuple[Source, str, Path | None]:
    """What a robot's name stands for: a planar arm, a library's, or a file's content and place.

    Raises:
        ArmdynError: the file is not in the study's folder, or cannot be read.
    """
    if robot in PLANAR_ARMS:
        return "planar", robot, None
    if not Path(robot).suffix:
        if not _NAME.fullmatch(robot):
            raise ProblemError(f"robot {shown(robot)}: r, rr, rrr, a library's name, or a .urdf or .xml file")
        return "library", robot, None
    place = (folder / robot).resolve()  # links followed
    if Path(robot).is_absolute() or not place.is_relative_to(folder.resolve()):
        raise ProblemError(f"robot {shown(robot)}: a study's files lie in its own folder or below")
    text = read_bounded(place, MAX_ROBOT).decode("utf-8", "replace")
    return ("mjcf" if is_mjcf(place) else "urdf"), text, place
