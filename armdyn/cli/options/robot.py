"""Options of the robot: its name, its moving joints, its payload."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import typer

import armdyn as ad
from armdyn import models
from armdyn.cli.options.groups import option
from armdyn.cli.parsing.panels import ROBOT
from armdyn.cli.parsing.positions import position, sliding_locks
from armdyn.errors import ProblemError, SpecError
from armdyn.parsing.numbers import numbers

TAKE_FILES = "mintime, bound, sweep, track, monte-carlo, tune and pid"
"""Commands that take a problem file for a robot."""


def known_names(incomplete: str) -> list[str]:
    """Names of robots with a beginning, for shell completion."""
    from armdyn.models.robots.library import BENCHMARKS, LIBRARY_ARMS

    return [name for name in (*models.PLANAR_ARMS, *BENCHMARKS, *LIBRARY_ARMS) if name.startswith(incomplete)]


RobotName = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="r, rr or rrr (the paper's arms), a URDF or MJCF file, a name of example-robot-data such as panda or "
        "ur5, a benchmark such as cart_pole, or a name of robot_descriptions such as panda_mj_description. Of most "
        "commands also a problem file, problem.toml.",
        show_default=False,
        autocompletion=known_names,
    ),
]


@dataclass(frozen=True, kw_only=True)
class PartOptions:
    """Choice of the moving joints.

    Attributes:
        lock: JOINT=Q of each joint that does not.
        part: FIRST,LAST of those that do.
    """

    panel: ClassVar[str] = ROBOT

    lock: list[str] | None = option(
        "JOINT=Q", "Fix a joint at a position \\[rad or m], such as 1.2, 90deg, 0.1m; may be given again."
    )
    part: str | None = option(
        "FIRST,LAST",
        "Only the joints from one joint or link to another move, all else is locked; a last link is the tip.",
        name="--arm",
    )

    def read(self, name: str, payload: ad.Payload | None = None) -> ad.Robot:
        """The robot of a name, as its URDF or MJCF describes it.

        Raises:
            ArmdynError: there is none of that name, or the joints are not its own.
        """
        if name in models.PLANAR_ARMS:
            if self.lock or self.part:
                option = "--lock" if self.lock else "--arm"
                raise SpecError(f"{option}: {name!r} has no joints to lock; it takes a URDF file or a library's robot")
            return ad.Robot.from_spec(ad.ArmSpec.paper(name), payload)
        robot = self._read(name, payload)
        sliding_locks(self.lock or (), robot)
        return robot

    def _read(self, name: str, payload: ad.Payload | None) -> ad.Robot:
        """The robot of a name that is not one of the paper's."""
        if name.lower().endswith(".toml"):
            raise SpecError(f"{name} is a problem file, which {TAKE_FILES} take; here a robot is needed")
        from armdyn.models.robots.source import RobotSource

        options = ad.RobotOptions(payload=payload, lock=self.locks(), arm=self.ends())
        return ad.Robot.from_source(RobotSource.named(name), options)

    def locks(self) -> dict[str, float] | None:
        """Joints to fix, and where [rad or m]."""
        pairs = [text.partition("=") for text in self.lock or ()]
        return {joint: position(value, f"--lock {joint}", None) for joint, _, value in pairs} or None

    def ends(self) -> tuple[str, str] | None:
        """First and last joint or link of the arm that moves."""
        if self.part is None:
            return None
        first, comma, last = (text.strip() for text in self.part.partition(","))
        if not (first and comma and last):
            raise SpecError(f"--arm: {self.part!r} is not FIRST,LAST: two joints or links with a comma between")
        return first, last


@dataclass(frozen=True, kw_only=True)
class RobotArgument:
    """A robot, and which of its joints move."""

    robot: RobotName
    part: PartOptions = field(default_factory=PartOptions)

    def read(self, payload: ad.Payload | None = None) -> ad.Robot:
        """The robot; see `PartOptions.read`."""
        return self.part.read(self.robot, payload)


@dataclass(frozen=True, kw_only=True)
class PayloadPlace:
    """Place of a payload.

    Attributes:
        payload_frame: frame that carries it; None: the tip.
        payload_com: its centre of mass there [m], as text; None: the frame's origin.
    """

    panel: ClassVar[str] = ROBOT

    payload_frame: str | None = option(
        "LINK", "Link or frame that the payload is fixed to; by default the tip, see doctor."
    )
    payload_com: str | None = option(
        "X,Y,Z", "The payload's centre of mass in that frame \\[m]; by default its origin."
    )

    def carried(self, mass: float) -> ad.Payload | None:
        """A payload of a mass [kg] at this place.

        Raises:
            ProblemError: its place is given, but not its mass.
        """
        if not mass and (self.payload_frame or self.payload_com):
            raise ProblemError("--payload-frame and --payload-com say where a payload is: give its mass, --payload KG")
        centre = (0.0, 0.0, 0.0) if self.payload_com is None else numbers(self.payload_com, "--payload-com")
        return ad.Payload(mass=mass, frame=self.payload_frame, com=centre) if mass else None


@dataclass(frozen=True, kw_only=True)
class PayloadOptions:
    """Payload and its place.

    Attributes:
        payload: its mass [kg].
        place: where it is.
    """

    panel: ClassVar[str] = PayloadPlace.panel

    payload: float = option("KG", "Point mass that the arm carries \\[kg].", default=0.0)
    place: PayloadPlace = field(default_factory=PayloadPlace)

    def carried(self) -> ad.Payload | None:
        """The payload; None for a mass of zero."""
        return self.place.carried(self.payload)
