"""Poses that have a name: those of an SRDF that lies by the URDF, an MJCF's keyframes, and those of a table.

SRDF, MoveIt's semantic description, has them as `<group_state name="home" group="arm"><joint name=… value=…/>…`:
http://wiki.ros.org/srdf. It is as untrusted as the URDF, and is read within the same bounds.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterable, Mapping
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armdyn.arguments import number, shown
from armdyn.arrays import Array
from armdyn.errors import ArmdynError, ProblemError, did_you_mean
from armdyn.models.reading.urdf_xml import parse_xml, read_urdf
from armdyn.models.values.per_joint import per_joint
from armdyn.parsing.numbers import position, to_number

if TYPE_CHECKING:
    from armdyn.models.robots.arm import Arm


_FOLDERS = (".", "../srdf", "../config")
"""Places of an SRDF relative to the URDF: next to it, or as in example-robot-data and MoveIt's packages."""
_MOST_FILES = 20
_MOST_POSES = 200
_LONGEST = 80
"""Most characters of a name."""
_LOOKED_AT = 1000
"""Most entries of a folder that are searched."""

_UR = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint")
_PANDA = tuple(f"panda_joint{i}" for i in range(1, 8))
_HALF = math.pi / 2

TABLE: tuple[tuple[tuple[str, ...], dict[str, tuple[float, ...]]], ...] = (
    (_UR, {"home": (0, -_HALF, 0, 0, 0, 0), "up": (0, -_HALF, 0, -_HALF, 0, 0)}),
    (_PANDA, {"ready": (0, -_HALF / 2, 0, -3 * _HALF / 2, 0, _HALF, _HALF / 2)}),
)
"""Joints of an arm, and its poses [rad]: Universal Robots' are those of ur_moveit_config, Panda's of MoveIt's SRDF."""


def named_poses(robot: Arm) -> dict[str, Array]:
    """The poses of a robot that have a name, each of shape (nv,) [rad or m].

    "zero" is all joints at zero, where the limits allow it. Of an SRDF's poses, of an MJCF's keyframes and of the table
    those count that say where every moving joint is, wherever locked joints are; a file that cannot be read has none.
    """
    poses = {}
    limits, zero = robot.limits, np.zeros(robot.nv)
    if np.all((limits.position_lower <= 0) & (limits.position_upper >= 0)):
        poses["zero"] = zero
    for joints, table in TABLE:
        if set(joints) <= {*robot.joint_names, *robot.locked}:
            poses |= _poses(((name, dict(zip(joints, q, strict=True))) for name, q in table.items()), robot.joint_names)
    for path in _files(robot):
        with suppress(ArmdynError):  # it was not requested; a bad file next to the URDF does not matter
            poses |= _of_file(path, robot)
    with suppress(ArmdynError):  # the MJCF has been changed since the robot was read
        poses |= _of_keyframes(robot)
    return poses


def names_of(poses: Iterable[str]) -> str:
    """The names of poses, in messages."""
    return ", ".join(poses) or "none: no SRDF is by its URDF, no keyframe in its MJCF"


def pose_given(robot: Arm, given: Any, what: str) -> Array:
    """Copy of joint positions given by a user, shape (nv,) [rad or m].

    Args:
        robot: whose joints.
        given: a number per joint, or the name of a pose.
        what: the quantity's name in messages.

    Raises:
        ProblemError: wrong length or not finite, or the robot has no pose of that name.
    """
    if not isinstance(given, str):
        try:
            return per_joint(given, robot.joint_names, what, unit="rad or m", error=ProblemError, scalar=False)
        except ProblemError as error:  # a wrong number of joints may be that of one arm of two
            notes = robot.notes if "has shape" in str(error) else ()
            raise ProblemError("; ".join([str(error), *notes])) from None
    poses = named_poses(robot)
    if given not in poses:
        expected = f"a number per joint [rad or m], or a pose of {robot.name} ({names_of(poses)})"
        raise ProblemError(f"{what} is {shown(given)}; expected {expected}{did_you_mean(given, poses)}")
    return poses[given].copy()


def positions_of(robot: Arm, given: object, what: str, *, degrees: bool = False) -> list[float]:
    """Positions of a robot's joints from numbers, text or a pose's name [rad or m].

    Their number is checked by the caller.

    Args:
        robot: whose joints.
        given: the name of a pose; text with commas between positions; or a list of numbers and texts such as "90deg".
        what: the option or key, for messages.
        degrees: see `armdyn.parsing.numbers.position`.

    Raises:
        ProblemError: the value is no position.
    """
    if isinstance(given, str):
        parts: list[object] = [*given.split(",")]
        if len(parts) == 1 and not _is_position(given):
            return list(map(float, pose_given(robot, given.strip(), what)))
    elif isinstance(given, list | tuple):
        parts = [*given]
    else:
        raise ProblemError(f"{what} is {shown(given)}; it must be {robot.nv} positions, or the name of a pose")
    slides = map(bool, robot.slides) if len(parts) == robot.nv else [None] * len(parts)
    return [position_of(part, what, joint, degrees=degrees) for part, joint in zip(parts, slides, strict=True)]


def position_of(given: object, what: str, slides: bool | None = None, *, degrees: bool = False) -> float:
    """One joint's position [rad or m]: a number, or a text as `armdyn.parsing.numbers.position` reads it.

    Raises:
        ProblemError: it is neither.
    """
    if isinstance(given, str):
        return position(given, what, slides, degrees=degrees)
    if isinstance(given, bool) or not isinstance(given, int | float):
        raise ProblemError(f"{what} has {shown(given)}; a position is a number [rad or m] or a text such as '90deg'")
    return number(given, what, finite=False)


def _is_position(text: str) -> bool:
    try:
        position(text, "", None)
    except ProblemError:
        return False
    return True


def _files(robot: Arm) -> list[Path]:
    """The SRDFs that may be of a robot's URDF: those of its name, or that name it."""
    if not robot.urdf or not os.path.isfile(robot.source):  # noqa: PTH113  # False of a text
        return []
    file = Path(robot.source)
    found: list[Path] = []
    for folder in _FOLDERS:
        try:
            entries = islice(os.scandir(file.parent / folder), _LOOKED_AT)
            found += sorted(Path(entry.path) for entry in entries if entry.name.endswith(".srdf"))
        except OSError:  # there is no such folder
            continue
    own = [path for path in found if path.stem == file.stem]
    return [*[path for path in found if path not in own][: _MOST_FILES - len(own)], *own]  # its own SRDF wins


def _of_file(path: Path, robot: Arm) -> dict[str, Array]:
    """The poses of an SRDF that are of the robot; groups may each have one of the same name."""
    root = parse_xml(read_urdf(path), str(path))
    if root.tag != "robot" or (root.get("name") != robot.model.name and path.stem != Path(robot.source).stem):
        return {}
    states = islice(root.iterfind("group_state"), _MOST_POSES)
    poses = (
        (state.get("name") or "", {str(each.get("name")): each.get("value", "") for each in state.iterfind("joint")})
        for state in states
    )
    return _poses(poses, robot.joint_names)


def _of_keyframes(robot: Arm) -> dict[str, Array]:
    """The poses that a robot's own MJCF names."""
    from armdyn.models.mjcf.reading import is_mjcf, read_keyframes, read_mjcf

    if robot.urdf or not os.path.isfile(robot.source) or not is_mjcf(robot.source):  # noqa: PTH113  # as in `_files`
        return {}
    keyframes = read_keyframes(read_mjcf(Path(robot.source)), robot.source, _MOST_POSES)
    return _poses(keyframes.items(), robot.joint_names)


def _poses(given: Iterable[tuple[str, Mapping[str, str | float]]], joints: tuple[str, ...]) -> dict[str, Array]:
    """Poses of a file with a name that can be typed and a finite position of every joint [rad or m]."""
    poses = {}
    for name, positions in given:
        try:
            q = np.array([to_number(str(positions[joint])) for joint in joints])
        except (KeyError, ValueError):
            continue
        if np.all(np.isfinite(q)) and name.isprintable() and 0 < len(name) <= _LONGEST:
            poses[name] = q
    return poses
