"""What the commands share: the arguments, and how a robot, poses and limits are read from them."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from armdyn.errors import ProblemError, SpecError
from armdyn.models import PAPER_ARMS, ArmSpec, Payload, Robot
from armdyn.studies.paper import Kind, example

RobotName = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="r, rr or rrr (the paper's arms), a URDF file, or a name of example-robot-data such as panda or ur5.",
        show_default=False,
    ),
]
QStart = Annotated[
    str | None,
    typer.Option(metavar="Q,Q,…", help="Start, one angle per joint \\[rad]; pi/20 works. r, rr, rrr: the paper's."),
]
QGoal = Annotated[str | None, typer.Option(metavar="Q,Q,…", help="Goal, like --q-start.")]
PayloadMass = Annotated[float, typer.Option("--payload", metavar="KG", help="Point mass at the tip \\[kg].")]
Lock = Annotated[
    list[str] | None,
    typer.Option(metavar="JOINT=Q", help="Fix a joint at a position \\[rad or m]; may be given again."),
]
EffortLimit = Annotated[str | None, typer.Option(metavar="T[,T…]", help="Torque limits instead of the URDF's \\[N m].")]
VelocityLimit = Annotated[
    str | None, typer.Option(metavar="V[,V…]", help="Velocity limits instead of the URDF's \\[rad/s]; inf for none.")
]
Out = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Folder for the results. By default results/COMMAND-ROBOT.")
]
Json = Annotated[bool, typer.Option("--json", help="One JSON object on standard output, nothing else.")]

_NUMBER = re.compile(r"([+-]?)(?:(\d+(?:\.\d*)?|\.\d+)\*?)?pi(?:/(\d+(?:\.\d*)?))?")


def number(text: str, what: str) -> float:
    """A number such as -1.5, 2e-3, inf, pi/20 or -3*pi/4.

    Raises:
        ProblemError: it is none.
    """
    text = text.strip()
    if match := _NUMBER.fullmatch(text):
        sign, factor, divisor = match.groups()
        if not divisor or float(divisor):
            return (-1 if sign == "-" else 1) * float(factor or 1) * np.pi / float(divisor or 1)
    try:
        return float(text)
    except ValueError:
        raise ProblemError(f"{what}: {text!r} is not a number") from None


def numbers(text: str, what: str) -> list[float]:
    """Comma-separated numbers."""
    return [number(part, what) for part in text.split(",")]


def one_or_more(text: str | None, what: str) -> float | list[float] | None:
    """One number for all joints, or one for each."""
    if text is None:
        return None
    values = numbers(text, what)
    return values[0] if len(values) == 1 else values


def load_robot(
    name: str,
    payload: float = 0.0,
    lock: Sequence[str] | None = None,
    effort_limit: str | None = None,
    velocity_limit: str | None = None,
) -> Robot:
    """The robot that a command names.

    Raises:
        ArmdynError: there is none of that name, or an option does not fit it.
    """
    load = Payload(mass=payload) if payload else None
    limits = (
        one_or_more(effort_limit, "--effort-limit"),
        one_or_more(velocity_limit, "--velocity-limit"),
    )
    if name in PAPER_ARMS:
        if lock:
            raise SpecError(f"--lock: {name!r} has no joints to lock; it takes a URDF file or a library's robot")
        robot = Robot.from_spec(ArmSpec.paper(name), payload=load)
        return robot.with_limits(*limits)
    locks: dict[str, float] | None = None
    if lock:
        pairs = [text.partition("=") for text in lock]
        locks = {joint: number(value, f"--lock {joint}") for joint, _, value in pairs}
    if Path(name).suffix or Path(name).exists():
        return Robot.from_urdf(name, load, locks, *limits)
    return Robot.from_library(name, load, locks, *limits)


def poses(robot: Robot, name: str, kind: Kind, q_start: str | None, q_goal: str | None) -> list[list[float]]:
    """Start and goal: what is given, else the paper's example.

    Raises:
        ProblemError: neither.
    """
    chosen = []
    for option, text in (("--q-start", q_start), ("--q-goal", q_goal)):
        if text is not None:
            chosen.append(numbers(text, option))
        elif name in PAPER_ARMS:
            paper = example(name, kind)
            chosen.append(list(paper.q_start if option == "--q-start" else paper.q_goal))
        else:
            joints = ", ".join(robot.joint_names)
            raise ProblemError(f"give {option} with {robot.nv} angles [rad] for {robot.name}: {joints}")
    return chosen


def slug(name: str) -> str:
    """A robot's name as part of a folder's."""
    return re.sub(r"[^A-Za-z0-9._-]+", "_", Path(name).stem) or "robot"
