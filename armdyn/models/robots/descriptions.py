"""Robots of the package robot_descriptions, where it is installed."""

import contextlib
import sys
import warnings
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from armdyn.arguments import shown, text
from armdyn.errors import SpecError, UnknownRobotError, UrdfError

PACKAGE = "robot_descriptions"
INSTALL = f"names that end so are of {PACKAGE}, which is not installed: pip install {PACKAGE}"


@dataclass(frozen=True)
class Description:
    """Place of a robot's description.

    Attributes:
        path: its URDF or MJCF.
        mjcf: it is MJCF.
        folders: where a URDF's meshes are.
    """

    path: Path
    mjcf: bool
    folders: tuple[str, ...]


def is_description(name: str) -> bool:
    """Whether a name looks like one of robot_descriptions."""
    return name.startswith(f"{PACKAGE}:") or name.endswith("_description")


def described(name: str) -> Description:
    """A robot's description, cloned by robot_descriptions if it was not yet.

    Args:
        name: the package's, with or without "robot_descriptions:" before it.

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
        # It tells of its cloning on stdout, where results go, and of names that it is to change.
        with contextlib.redirect_stdout(sys.stderr), warnings.catch_warnings():
            warnings.simplefilter("ignore", FutureWarning)
            module = import_module(f"{PACKAGE}.{name}")
    except Exception as error:  # no git, no network, no room: whatever its cloning meets
        what = f"{PACKAGE} cannot provide it ({shown(error)}); it clones robots from the internet the first time"
        raise UrdfError(name, what) from None
    if (urdf := getattr(module, "URDF_PATH", None)) is not None:
        homes = (module.PACKAGE_PATH, module.REPOSITORY_PATH, str(Path(module.PACKAGE_PATH).parent))
        return Description(Path(urdf), False, tuple(map(str, homes)))
    if (mjcf := getattr(module, "MJCF_PATH", None)) is not None:
        return Description(Path(mjcf), True, ())
    raise UrdfError(name, f"{PACKAGE} has it as xacro only; run xacro and give armdyn the URDF")
