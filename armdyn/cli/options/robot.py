"""Options of the robot: its name, its moving joints, its payload."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import armdyn as ad
from armdyn import models
from armdyn.cli.invocation import flag_of
from armdyn.cli.options.groups import ROBOT, Numbers, argument, group, option
from armdyn.cli.options.path_constraints import obstacles_of
from armdyn.cli.options.poses import check_units_of_sliding_locks, position
from armdyn.errors import ProblemError, SpecError
from armdyn.parsing.numbers import FREE, number

TAKE_FILES = "mintime, bound, sweep, track, monte-carlo, tune and pid"
"""Commands that take a problem file for a robot."""


def kind_of_file(name: str) -> Literal["", "robot", "problem", "study"]:
    """Kind of the TOML file that a robot's name is; empty: it is the name of a robot.

    A robot's file has the table [robot] alone, as `armdyn identify` writes it; a study file neither [robot] nor
    [problem].

    Raises:
        ArmdynError: it is a TOML file and cannot be read.
    """
    from armdyn.parsing.toml import read_toml

    if not name.lower().endswith(".toml"):
        return ""
    keys = read_toml(name).values.keys()
    return "robot" if keys == {"robot"} else "problem" if {"robot", "problem"} & keys else "study"


def only_in_the_file(option: str, name: str) -> ProblemError:
    """The refusal of an option that only a file may set where one is given."""
    return ProblemError(f"{flag_of(option)}: with a file it is read from the file alone; write it into {name}")


def known_names(incomplete: str) -> list[str]:
    """Names of robots with a beginning, for shell completion."""
    from armdyn.models.robots.library import BENCHMARKS, LIBRARY_ARMS

    return [name for name in (*models.PLANAR_ARMS, *BENCHMARKS, *LIBRARY_ARMS) if name.startswith(incomplete)]


def ends_of(text: str, option: str = "--arm") -> tuple[str, str]:
    """First and last joint or link of the arm that moves.

    Raises:
        SpecError: the text does not have both.
    """
    first, comma, last = (one.strip() for one in text.partition(","))
    if not (first and comma and last):
        raise SpecError(f"{option}: {text!r} is not FIRST,LAST: two joints or links with a comma between")
    return first, last


def mount_of(text: str, option: str = "--mount") -> tuple[tuple[float, ...], ...]:
    """Placement of a base, as rows of its matrix.

    Raises:
        ProblemError: the text is no position [m], with or without roll, pitch and yaw.
    """
    from armdyn.models.values.placement import pose_of, pose_rows

    values = text.split(",")
    if len(values) not in (3, 6):
        raise ProblemError(f"{option} {text!r}: write X,Y,Z or X,Y,Z,ROLL,PITCH,YAW [m; rad, 90deg works]")
    turn = [position(value, option) for value in values[3:]]
    return pose_rows(pose_of([number(value, option) for value in values[:3]], None, turn or None, option), option)


@group(ROBOT)
class PartOptions:
    """Choice of the moving joints, and the tool.

    Attributes:
        lock: JOINT=Q of each joint that does not move.
        part: first and last joint or link of those that do.
        mount: placement of the base in the world, rows of its matrix.
        tool: a file with the tool.
        package_dir: folders of the meshes' packages.
    """

    lock: list[str] | None = option(
        "JOINT=Q",
        "Fix a joint at a position \\[rad or m], such as 1.2, 90deg, 0.1m; may be given again. Named poses are then "
        "those of the other joints. A gripper's joints are fixed by default; JOINT=free moves one.",
    )
    part: Annotated[tuple[str, str] | None, ends_of] = option(
        "FIRST,LAST",
        "Only the joints from one joint or link to another move, all else is locked; a last link is the tip.",
        name="--arm",
    )
    mount: Annotated[tuple[tuple[float, ...], ...] | None, mount_of] = option(
        "X,Y,Z[,ROLL,PITCH,YAW]",
        "Place of the base in the world \\[m; rad, or degrees with --degrees; 90deg works]: 0,0,2.5,180deg,0,0 hangs "
        "from a ceiling. Gravity, obstacles and goal poses stay in the world.",
    )
    tool: str | None = option(
        "FILE.toml",
        "Tool at the arm's end: mass, com, inertia, shapes and tip (docs/payloads.md); its tip is the arm's.",
    )
    package_dir: list[str] | None = option(
        "DIR",
        "Folder in which package:// of the URDF's meshes is looked up, besides the file's own folder and package; may "
        "be given again.",
    )

    def read(self, name: str, payload: ad.Payload | None = None, tool: ad.Tool | None = None) -> ad.Robot:
        """The robot of a name, as its URDF or MJCF describes it; with the tool of a file if one is named.

        Raises:
            ArmdynError: the name is unknown, or the robot has no such joints.
        """
        from armdyn.models.robots.source import RobotSource

        if name in models.PLANAR_ARMS and (self.lock or self.part):
            option = "--lock" if self.lock else "--arm"
            raise SpecError(f"{option}: {name!r} has no joints to lock; it takes a URDF file or a library's robot")
        if (kind := kind_of_file(name)) == "robot":
            return self._of_file(name, payload)
        if kind:
            raise SpecError(f"{name} is a problem file, which {TAKE_FILES} take; here a robot is needed")
        tool, folders = self._tool() or tool, tuple(self.package_dir or ())
        options = ad.RobotOptions(
            payload=payload, tool=tool, lock=self.locks(), arm=self.part, mount=self.mount, package_dirs=folders
        )
        robot = ad.Robot.from_source(RobotSource.named(name), options).noted()
        check_units_of_sliding_locks(self.lock or (), robot)
        return robot

    def _of_file(self, name: str, payload: ad.Payload | None) -> ad.Robot:
        """The robot of a file with the table [robot] alone."""
        from armdyn.models.tables import robot_from
        from armdyn.parsing.toml import read_toml

        for one in ("lock", "part", "mount", "tool"):
            if getattr(self, one):
                raise only_in_the_file(one, name)
        robot = robot_from(read_toml(name).table("robot"))
        return robot if payload is None else robot.with_payload(payload)

    def locks(self) -> dict[str, float | Literal["free"]] | None:
        """Joints to fix, and where [rad or m]; "free": a gripper's joint that moves."""
        pairs = [text.partition("=") for text in self.lock or ()]
        return {
            joint: FREE if value.strip() == FREE else position(value, f"--lock {joint}", None)
            for joint, _, value in pairs
        } or None

    def _tool(self) -> ad.Tool | None:
        """The tool that the file describes; None: no file was named."""
        if self.tool is None:
            return None
        from armdyn.models.scene.obstacles import TOOL_KEYS, tool_from
        from armdyn.parsing.toml import read_toml

        table = read_toml(self.tool)
        table.only(TOOL_KEYS)
        if not table.values:
            raise ProblemError(f"--tool: {self.tool} has no tool: write its mass, tip or shapes")
        with table.locating_errors({}):
            return tool_from(table.values, Path(table.path).parent)


@group()
class RobotArgument:
    """A robot, and which of its joints move."""

    robot: str = argument(
        "ROBOT",
        "r, rr or rrr (the paper's arms), a URDF or MJCF file, a name of example-robot-data such as panda or ur5, a "
        "benchmark such as cart_pole, a name of robot_descriptions such as panda_mj_description, or a file with "
        "\\[robot] alone, such as identified.toml. Of most commands also a problem file, problem.toml.",
        show_default=False,
        autocompletion=known_names,
    )
    part: PartOptions

    def read(self, payload: ad.Payload | None = None) -> ad.Robot:
        """The robot; see `PartOptions.read`."""
        return self.part.read(self.robot, payload)


@group(ROBOT)
class PayloadPlace:
    """Place and shapes of a payload.

    Attributes:
        payload_frame: frame that carries it; None: the tip.
        payload_com: its centre of mass there [m]; None: the frame's origin.
        payload_shape: its shapes there, as --obstacle has them; None: it has no size.
    """

    payload_frame: str | None = option(
        "LINK", "Link or frame that the payload is fixed to; by default the tip, see doctor."
    )
    payload_com: Numbers = option("X,Y,Z", "The payload's centre of mass in that frame \\[m]; by default its origin.")

    payload_shape: list[str] | None = option(
        "SHAPE",
        "Shape of the payload in that frame, such as box:0.06,0.06,0.2@0,0,0.1 or another shape of --obstacle: "
        "it is kept clear of obstacles, too. May be given again.",
    )

    def carried(self, mass: float) -> ad.Payload | None:
        """A payload of a mass [kg] at this place.

        Raises:
            ProblemError: its place is given, but neither mass nor shape; or a shape is malformed.
        """
        shapes = obstacles_of(self.payload_shape, "--payload-shape") if self.payload_shape else ()
        if not mass and not shapes and (self.payload_frame or self.payload_com):
            raise ProblemError("--payload-frame and --payload-com say where a payload is: give its mass, --payload KG")
        if not mass and not shapes:
            return None
        return ad.Payload(mass=mass, frame=self.payload_frame, com=self.payload_com or (0.0, 0.0, 0.0), shapes=shapes)


@group(ROBOT)
class PayloadOptions:
    """Payload and its place.

    Attributes:
        payload: its mass [kg].
        place: where it is.
    """

    payload: float = option("KG", "Mass that the arm carries \\[kg].", default=0.0)
    place: PayloadPlace

    def carried(self) -> ad.Payload | None:
        """The payload; None without mass and shape."""
        return self.place.carried(self.payload)
