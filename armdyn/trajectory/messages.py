"""ROS 2's trajectory_msgs/msg/JointTrajectory, read from JSON or YAML.

https://docs.ros.org/en/rolling/p/trajectory_msgs/msg/JointTrajectory.html
"""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from armdyn.arguments import shown
from armdyn.arrays import Array
from armdyn.errors import ProblemError, TrajectoryError, reraised
from armdyn.files import read_bounded
from armdyn.parsing.numbers import to_number
from armdyn.parsing.yaml_text import read_yaml
from armdyn.trajectory.formats.ros2 import HELD

SUFFIXES = (".json", ".yaml", ".yml")

MAX_BYTES = 32 * 2**20
"""A larger message is refused [bytes]; of JSON each byte may take ten in memory."""

_WHOLE = re.compile("-?[0-9]{1,16}")
_KINDS = {"positions": "q", "velocities": "v", "accelerations": "a", "effort": "tau"}
_INSIDE = ("trajectory", "joint_trajectory", "goal")
"""Fields of messages that have one inside: FollowJointTrajectory's goal, MoveIt's RobotTrajectory."""
_USAGE = "a JointTrajectory has joint_names, and points with positions and time_from_start"


@dataclass(frozen=True)
class Content:
    """Parsed content of a motion's file.

    Attributes:
        names: of its joints, or of all columns.
        columns: from the robot's joints to t [s], shape (n,); q, and perhaps v, a, tau, each of shape (n, nv).
        called: name of a sample by its index, as the user counts it.
        held: torques are means until the next row.
        message: it is ROS 2's: `names` are joints alone, in their order.
    """

    names: Sequence[str]
    columns: Callable[[Sequence[str]], dict[str, Array]]
    called: Callable[[int], str]
    held: bool = False
    message: bool = False


def read_message(file: Path) -> Content:
    """Read a message: its joints may come in any order; others than the robot's, such as a gripper's, are left out.

    The content is parsed as JSON, else as YAML, as `ros2 topic echo --once` prints it.

    Args:
        file: .json, .yaml or .yml.

    Raises:
        FileError: the file cannot be read.
        TrajectoryError: it is no message; of its columns: one of another robot.
    """
    message = _message(file, _content(file))
    names, header = message.get("joint_names"), message.get("header")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names) or not names:
        raise TrajectoryError(f"{file}: joint_names is {shown(names)}; it must be a list of names")
    held = isinstance(header, Mapping) and header.get("frame_id") == HELD

    def columns(joints: Sequence[str]) -> dict[str, Array]:
        points = message.get("points")
        if not isinstance(points, list) or len(points) < 2:
            count = len(points) if isinstance(points, list) else shown(points)
            raise TrajectoryError(f"{file}: points: {count}; a motion has two or more")
        order = _order(file, names, joints)
        for k, point in enumerate(points):
            if not isinstance(point, Mapping):
                raise TrajectoryError(f"{file}: points[{k}] is {shown(point)}; {_USAGE}")
        found = {"t": np.array([_stamp(file, k, point.get("time_from_start")) for k, point in enumerate(points)])}
        for kind, what in _KINDS.items():
            if (rows := _columns(file, kind, points, len(names))) is not None:
                found[what] = rows[:, order]
        return found

    return Content(names, columns, "points[{}]".format, held, message=True)


def _content(file: Path) -> object:
    """Parsed content of a file: JSON, or else YAML, whose numbers stay text."""
    data = read_bounded(file, MAX_BYTES)
    try:
        return json.loads(data)
    except (ValueError, RecursionError, MemoryError) as error:
        if file.suffix.lower() == ".json":
            raise TrajectoryError(f"{file}: not JSON ({str(error)[:200]})") from None
    with reraised(TrajectoryError, "", ProblemError):
        return read_yaml(file)


def _message(file: Path, content: object) -> Mapping[Any, Any]:
    """The JointTrajectory, unwrapped from a message around it."""
    for _ in range(3):  # goal.trajectory.joint_trajectory is the deepest
        inside = next((key for key in _INSIDE if isinstance(content, Mapping) and key in content), None)
        content = content[inside] if isinstance(content, Mapping) and inside else content
    if not isinstance(content, Mapping) or "points" not in content:
        raise TrajectoryError(f"{file}: no JointTrajectory; {_USAGE}")
    return content


def _order(file: Path, names: list[str], joints: Sequence[str]) -> list[int]:
    """Indices of the robot's joints in the message."""
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise TrajectoryError(f"{file}: joint_names has {shown(twice)} twice")
    missing = [joint for joint in joints if joint not in names]
    if missing:
        raise TrajectoryError(
            f"{file}: joint_names are {', '.join(names)[:300]}; joint {missing[0]!r} is not among them. The robot "
            f"moves {', '.join(joints)}"
        )
    return [names.index(joint) for joint in joints]


def _stamp(file: Path, k: int, given: object) -> float:
    """The time of a point [s]; ROS 1 calls the same fields secs and nsecs."""
    fields = given if isinstance(given, Mapping) else {}
    stamp = (fields.get("sec", fields.get("secs")), fields.get("nanosec", fields.get("nsecs")))
    parts = [int(part) if isinstance(part, str) and _WHOLE.fullmatch(part) else part for part in stamp]
    if not all(isinstance(part, int) and not isinstance(part, bool) and abs(part) < 2**53 for part in parts):
        raise TrajectoryError(
            f"{file}: time_from_start of points[{k}] is {shown(given)}; it must be sec and nanosec, whole numbers"
        )
    return float(parts[0] + parts[1] / 1e9)


def _columns(file: Path, kind: str, points: Sequence[Mapping[Any, Any]], width: int) -> Array | None:
    """One kind of number of all points, shape (n, width); None where no point has it: a list without entries."""
    rows = [point.get(kind) or [] for point in points]
    if all(row == [] for row in rows):
        return None
    for k, row in enumerate(rows):
        if not isinstance(row, list) or len(row) != width:
            found = len(row) if isinstance(row, list) else shown(row)
            raise TrajectoryError(f"{file}: {kind} of points[{k}]: {found}; one of each of {width} joints is needed")
    values = []
    for k, row in enumerate(rows):
        for value in row:
            try:
                values.append(_number(value))
            except (TypeError, ValueError, OverflowError):
                raise TrajectoryError(f"{file}: {kind} of points[{k}] has {shown(value)}, which is no number") from None
    return np.reshape(values, (len(rows), width))


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise TypeError
    number = to_number(value) if isinstance(value, str) else float(value)
    if not abs(number) < float("inf"):
        raise ValueError
    return number
