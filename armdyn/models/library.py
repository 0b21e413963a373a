"""The arms of example-robot-data."""

import os
from pathlib import Path

from armdyn.errors import UnknownRobotError, UrdfError

LIBRARY_LOCKS: dict[str, dict[str, float]] = {
    "panda": {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0},
}
"""Joints of the library's robots that are no arm joints, and where `from_library` locks them by default."""


def library_urdf(name: str) -> tuple[Path, str]:
    """A library robot's URDF file, and the folder in which its `package://` is.

    Raises:
        UnknownRobotError: the library has no such robot.
        UrdfError: the robot is not described by a URDF.
    """
    from example_robot_data.robots_loader import ROBOTS, getModelPath

    if name not in ROBOTS:
        raise UnknownRobotError(name, sorted(ROBOTS))
    loader = ROBOTS[name]
    if not loader.urdf_filename:
        raise UrdfError(name, "the library describes it by an SDF, not a URDF")
    inside = Path(loader.path, loader.urdf_subpath, loader.urdf_filename)
    root = Path(loader.model_path or getModelPath(str(inside)))
    return Path(os.path.normpath(root / inside)), os.path.normpath(root.parent.parent)
