"""Robots by name: arms of example-robot-data, the package's own benchmarks, robots of robot_descriptions."""

import contextlib
import csv
import os
import sys
import warnings
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Literal

from armdyn.arguments import shown, text
from armdyn.errors import SpecError, UnknownRobotError, UrdfError

PACKAGE = "robot_descriptions"
INSTALL = f"names that end so are of {PACKAGE}, which is not installed: pip install {PACKAGE}"


def is_description(name: str) -> bool:
    """Whether a name looks like one of robot_descriptions."""
    return name.startswith(f"{PACKAGE}:") or name.endswith("_description")


def described(name: str) -> tuple[Literal["urdf", "mjcf"], str, tuple[str, ...]]:
    """A robot's description, cloned by robot_descriptions if it was not yet.

    Args:
        name: the package's, with or without "robot_descriptions:" before it.

    Returns:
        Format of the description, its file, and the folders of a URDF's meshes.

    Raises:
        UnknownRobotError: it has no such robot, or is not installed.
        UrdfError: it cannot provide the robot, or has it only as xacro.
    """
    name = text(name, "name of a robot", error=SpecError).removeprefix(f"{PACKAGE}:")
    try:
        known = import_module(PACKAGE).DESCRIPTIONS
    except ImportError:
        raise UnknownRobotError(name, (), INSTALL) from None
    if name not in known:
        raise UnknownRobotError(name, sorted(known))
    try:
        # It prints its cloning, and names that it will change, on stdout, where results go.
        with contextlib.redirect_stdout(sys.stderr), warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)
            module = import_module(f"{PACKAGE}.{name}")
    except Exception as error:  # no git, no network, no room: any error of its cloning
        what = f"{PACKAGE} cannot provide it ({shown(error)}); it clones robots from the internet the first time"
        raise UrdfError(name, what) from None
    if (urdf := getattr(module, "URDF_PATH", None)) is not None:
        homes = (module.PACKAGE_PATH, module.REPOSITORY_PATH, str(Path(module.PACKAGE_PATH).parent))
        return "urdf", str(urdf), tuple(map(str, homes))
    if (mjcf := getattr(module, "MJCF_PATH", None)) is not None:
        return "mjcf", str(mjcf), ()
    raise UrdfError(name, f"{PACKAGE} has it as xacro only; run xacro and give armdyn the URDF")


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
"""The benchmarks of underactuated control, and which of their joints have no motor. A URDF's torque limit of
zero, which often marks a missing one, could not say that. The sources of their numbers are in their files."""

_CORRECTED = {"ur3": "ur3_robot.urdf"}
"""Files that the loaders 5 get wrong: their "ur3" is a UR5."""


def library_names() -> list[str]:
    """All names of `library_arm`."""
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
