"""The robots that go by a name: the arms of example-robot-data, and the package's own benchmarks."""

import csv
import os
from dataclasses import dataclass
from pathlib import Path

from armdyn.arguments import text
from armdyn.errors import SpecError, UnknownRobotError, UrdfError
from armdyn.models.robots.descriptions import is_description


@dataclass(frozen=True)
class LibraryArm:
    """An arm inside a robot of the library.

    Attributes:
        robot: the library's name of the robot.
        first: the arm's first joint, or the link that it stands on.
        last: its last joint, or its tip.
    """

    robot: str
    first: str
    last: str


_HERE = Path(__file__).parent

LIBRARY_ARMS: dict[str, LibraryArm] = {
    row.pop("name"): LibraryArm(**row)
    for row in csv.DictReader((_HERE / "library.csv").read_text("utf-8").splitlines())
}
"""The library's arms, and those inside its bigger robots; all else of the robot is locked."""

BENCHMARKS: dict[str, tuple[str, ...]] = {
    "acrobot": ("shoulder",),
    "cart_pole": ("pole",),
    "furuta_pendulum": ("pendulum",),
    "pendubot": ("elbow",),
}
"""The benchmarks of underactuated control, and which of their joints have no motor. A URDF's torque limit of zero, by
which many mean none at all, could not say that. Where their numbers come from is said in their files."""

_CORRECTED = {"ur3": "ur3_robot.urdf"}
"""Files that the loaders 5 get wrong: their "ur3" is a UR5."""


def library_names() -> list[str]:
    """All names that `library_arm` knows."""
    from example_robot_data.robots_loader import ROBOTS

    return sorted({*ROBOTS, *LIBRARY_ARMS, *BENCHMARKS})


def other_robots() -> list[str]:
    """The library's robots that are in `LIBRARY_ARMS` neither by name nor by an arm of theirs."""
    from example_robot_data.robots_loader import ROBOTS

    return sorted(set(ROBOTS) - set(LIBRARY_ARMS) - {arm.robot for arm in LIBRARY_ARMS.values()})


def library_arm(name: str) -> tuple[Path, str, LibraryArm | None]:
    """URDF file of an arm, folder of its `package://`, and its joints.

    Args:
        name: of `LIBRARY_ARMS` or `BENCHMARKS`, or any robot of the library: but for the first no choice of joints
            comes back.

    Raises:
        SpecError: the name is no text.
        UnknownRobotError: the library has neither.
        UrdfError: the robot is not described by a URDF.
    """
    arm = LIBRARY_ARMS.get(text(name, "name of a robot", error=SpecError))
    if name in BENCHMARKS:
        return _HERE / "urdf" / f"{name}.urdf", str(_HERE / "urdf"), None
    if name not in (known := library_names()):
        hint = "" if not is_description(name) else "Robot.from_description reads those of robot_descriptions"
        raise UnknownRobotError(name, known, hint)
    return *library_urdf(name if arm is None else arm.robot), arm


def library_urdf(robot: str) -> tuple[Path, str]:
    """A library robot's URDF file, and the folder in which its `package://` is.

    Raises:
        UnknownRobotError: the library has no such robot.
        UrdfError: the robot is not described by a URDF.
    """
    from example_robot_data.robots_loader import ROBOTS, getModelPath

    if robot not in ROBOTS:
        raise UnknownRobotError(robot, sorted(ROBOTS))
    loader = ROBOTS[robot]
    if not loader.urdf_filename:
        raise UrdfError(robot, "the library describes it by an SDF, not a URDF")
    inside = Path(loader.path, loader.urdf_subpath, _CORRECTED.get(robot, loader.urdf_filename))
    root = Path(loader.model_path or getModelPath(str(inside)))
    return Path(os.path.normpath(root / inside)), os.path.normpath(root.parent.parent)
