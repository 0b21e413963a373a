"""Source of a robot: a file, a text, a library's name, numbers, or Pinocchio's model."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pinocchio as pin

from armdyn.arguments import shown
from armdyn.errors import FileError, SpecError, UnknownRobotError
from armdyn.files import place_inside
from armdyn.models.mjcf.document import is_mjcf
from armdyn.models.robots.library import described, is_description, library_names
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.spec import PLANAR_ARMS, ArmSpec

Format = Literal["spec", "library", "urdf", "mjcf", "model"]


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotSource:
    """Source of a robot; `Robot.from_source` reads it.

    Attributes:
        format: of the description.
        name: of the library's arm; of a file its path; else the name of the source in messages.
        text: the URDF or MJCF; None: the file of that name.
        spec: the arm, of the format "spec".
        model: the model, of the format "model".
        limits: of the joints that move, of the format "model"; None: the model's.
        package_dirs: folders in which `package://` is looked up.
    """

    format: Format
    name: str
    text: str | None = None
    spec: ArmSpec | None = None
    model: pin.Model | None = None
    limits: JointLimits | None = None
    package_dirs: tuple[str, ...] = ()

    @property
    def file(self) -> Path | None:
        """The file that the robot is read from, if it is one."""
        return Path(self.name) if self.format in ("urdf", "mjcf") and self.text is None else None

    @classmethod
    def of_spec(cls, spec: ArmSpec) -> RobotSource:
        """The source of a planar arm."""
        return cls(format="spec", name=f"ArmSpec {spec.name!r}", spec=spec)

    @classmethod
    def of_description(cls, name: str) -> RobotSource:
        """The source of a robot of robot_descriptions, by its name there; see `library.described`."""
        kind, file, folders = described(name)
        return cls(format=kind, name=file, package_dirs=folders)

    @classmethod
    def named(cls, name: str) -> RobotSource:
        """Source of a robot by its name: r, rr or rrr, a file, a name of robot_descriptions, or one of the library.

        Raises:
            UnknownRobotError: there is no robot of that name.
        """
        if name in PLANAR_ARMS:
            return cls.of_spec(ArmSpec.paper(name))
        if Path(name).suffix or Path(name).is_file():
            return cls(format="mjcf" if is_mjcf(name) else "urdf", name=name)
        if is_description(name):
            return cls.of_description(name)
        if name not in (known := library_names()):
            raise UnknownRobotError(name, (*PLANAR_ARMS, *known))
        return cls(format="library", name=name)

    @classmethod
    def inside(cls, name: str, folder: str | os.PathLike[str]) -> RobotSource:
        """The source of a name in an untrusted file: no download, and no file outside a folder.

        Args:
            name: of the robot, or its file seen from the folder.
            folder: of the untrusted file; links are followed.

        Raises:
            SpecError: the robot's file is outside the folder, or the name is one of robot_descriptions.
        """
        if is_description(name):
            raise SpecError(f"{shown(name)} is fetched from the internet, which a problem file does not do")
        try:
            file = place_inside(folder, name)
        except FileError as error:
            raise SpecError(f"{shown(name)} {error.why}") from None
        # A name too long is no file.
        is_file = name not in PLANAR_ARMS and (Path(name).suffix or os.path.isfile(file))  # noqa: PTH113
        return cls.named(str(file) if is_file else name)
