"""Source of a robot, such as a file or a library's name, and options of the readers: payload, locks, limits."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, TypedDict

import pinocchio as pin
from numpy.typing import ArrayLike

from armdyn.arguments import Checked, checked, each, expect, path_of, several, shown
from armdyn.errors import FileError, SpecError, UnknownRobotError, UrdfError
from armdyn.files import place_inside
from armdyn.models.mjcf.reading import is_mjcf
from armdyn.models.robots.library import described, is_description, library_names
from armdyn.models.values.friction import FrictionValue
from armdyn.models.values.joint_limits import JointLimits
from armdyn.models.values.per_joint import JointNumbers
from armdyn.models.values.placement import Placement
from armdyn.models.values.spec import PLANAR_ARMS, ArmSpec, Payload, Tool, placed
from armdyn.reprs import brief

Format = Literal["spec", "library", "urdf", "mjcf", "model"]

_NO_ROBOTS = (".npz", ".csv", ".tsv", ".json", ".yaml", ".yml")
"""Suffixes of motions, logs, results and scenes, which are often given for the robot's file."""


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
            UrdfError: the name is that of a motion's, log's or result's file.
        """
        if name in PLANAR_ARMS:
            return cls.of_spec(ArmSpec.paper(name))
        if Path(name).suffix.lower() in _NO_ROBOTS:
            raise UrdfError(
                name, "no robot: a robot is a URDF or MJCF file, a problem file (.toml), or a name of `armdyn robots`"
            )
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


class RobotKeywords(TypedDict, total=False):
    """The keywords of every reader of robots besides the payload: the fields of `RobotOptions`, or it as a whole."""

    options: RobotOptions | None
    tool: Tool | None
    lock: Mapping[str, float | Literal["free"]] | None
    arm: tuple[str, str] | None
    mount: Placement | None
    effort_limit: JointNumbers | None
    velocity_limit: JointNumbers | None
    torque_speed: Mapping[str, ArrayLike] | None
    armature: JointNumbers | None
    rotor_inertia: JointNumbers | None
    gear_ratio: JointNumbers | None
    damping: FrictionValue | None
    friction: FrictionValue | None
    friction_width: JointNumbers | None
    passive: Sequence[str]
    inertias: Mapping[str, ArrayLike] | None
    package_dirs: Sequence[str | os.PathLike[str]]


def _ends_of_arm(arm: object, name: str) -> tuple[str, ...]:
    ends = several(arm, name, error=SpecError)
    if len(ends) != 2 or not all(isinstance(end, str) for end in ends):
        raise SpecError(f"{name} is {shown(arm)}; it must be (first, last), each the name of a joint or a link")
    return tuple(map(str, ends))


@brief
@dataclass(frozen=True, kw_only=True, eq=False)
class RobotOptions(Checked):
    """Options of the readers of robots. Every reader takes these fields as keywords, or the whole value as `options`.

    Attributes:
        payload: fixed to `payload.frame`, by default the tip: of the tool, or of the arm, the end of the longest
            chain. Joints behind it that are locked side by side, as a gripper's fingers, are no part of that chain.
        tool: fixed to `tool.frame`, by default the arm's own tip; the tip is then the tool's.
        lock: joints to fix, name to position [rad or m]; in a model a joint of several coordinates at 0, its neutral.
            A gripper's joints, in a URDF or MJCF of which no `arm` is chosen, are fixed at zero or at the bound nearest
            to it: "free" as the position lets one move, see `Arm.notes`.
        arm: (first, last), each a joint or a link (in an MJCF a body or a site, in a model a frame): the joints on the
            way from one to the other move, all others of the robot are locked, at zero or at the bound nearest to it
            unless `lock` says where. A last link is the tip. None: all joints move but those of `lock`, and a `<mimic>`
            joint whose leader is locked, which follows it; of a library's robot those of `LIBRARY_ARMS`.
        mount: placement of the base in the world, on a wall or a ceiling: a position [m], shape (3,), or a pose, shape
            (4, 4) or `pin.SE3`; gravity, obstacles and goal poses stay in the world. Kept as the rows of the matrix.
            None: where the file has it.
        effort_limit: torque limits: one number, or one per joint [N m or N]; None: the file's.
        velocity_limit: one number, or one per joint [rad/s or m/s]; None: the file's.
        torque_speed: torque-speed curves of motors, joint name to [speed [rad/s or m/s], torque [N m or N]] of two or
            more points; see `Robot.with_torque_speed`.
        armature: reflected rotor inertia: one number, or one per joint [kg m² or kg]; None: the file's.
        rotor_inertia: with gear_ratio instead of armature, about the rotors' own axes, see `Robot.with_armature`
            [kg m²].
        gear_ratio: turns of the rotor for one of the joint [-], or angle of the rotor over way of the joint [rad/m].
        damping: viscous friction of the joints: one number, or one per joint [N m s/rad or N s/m]; "urdf": the file's,
            `<dynamics damping=…>`; 0: none. None: the file's, but none for a library's robot, whose numbers are there
            to calm simulators: z1 and talos_arm have 1 for every joint, panda 0.003 with `mu_viscous="16"`.
        friction: Coulomb friction [N m or N], likewise; in a URDF `<dynamics friction=…>`.
        friction_width: speed over which Coulomb friction changes its sign, see `JointFriction` [rad/s or m/s].
        passive: names of joints without a motor; their torque limits are zero.
        inertias: inertia of all bodies on a joint instead of the file's, tool included, payload not: joint name to
            m, m c (3), Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the joint's origin along its axes [kg, kg m, kg m²], which
            are Pinocchio's dynamic parameters; see `armdyn.identify`.
        package_dirs: folders of `package://` meshes, besides the file's own folder and ROS package. Dynamics need no
            mesh.

    Raises:
        SpecError: tool is no tool, lock no mapping, arm no pair of names, mount no placement, or package_dirs no list
            of paths.
    """

    payload: Payload | None = None
    tool: Tool | None = checked(expect, None, kind=Tool, hint="Tool(mass=…, tip=…)", error=SpecError)
    lock: Mapping[str, float | Literal["free"]] | None = checked(
        expect, None, kind=Mapping, hint="joint name to position [rad or m]", error=SpecError
    )
    arm: tuple[str, str] | None = checked(_ends_of_arm, None)
    mount: Placement | None = checked(placed, None)
    effort_limit: JointNumbers | None = None
    velocity_limit: JointNumbers | None = None
    torque_speed: Mapping[str, ArrayLike] | None = None
    armature: JointNumbers | None = None
    rotor_inertia: JointNumbers | None = None
    gear_ratio: JointNumbers | None = None
    damping: FrictionValue | None = None
    friction: FrictionValue | None = None
    friction_width: JointNumbers | None = None
    passive: Sequence[str] = ()
    inertias: Mapping[str, ArrayLike] | None = checked(
        expect, None, kind=Mapping, hint="joint name to ten inertial parameters", error=SpecError
    )
    package_dirs: Sequence[str | os.PathLike[str]] = checked(each, (), of=path_of, error=SpecError)


def robot_options(payload: Payload | None, keywords: RobotKeywords) -> RobotOptions:
    """The options that a reader was called with: `options`, changed by the payload and keywords that were given.

    Raises:
        SpecError: see `RobotOptions`.
    """
    changes: dict[str, Any] = {name: value for name, value in keywords.items() if name != "options"}
    if payload is not None:
        changes["payload"] = payload
    own = keywords.get("options")
    own = RobotOptions() if own is None else own
    return replace(expect(own, RobotOptions, "options", "RobotOptions(payload=…)", error=SpecError), **changes)
