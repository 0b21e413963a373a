"""What the commands share: the arguments, and how a robot, poses and limits are read from them."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from armdyn.errors import ProblemError, SpecError
from armdyn.models import PAPER_ARMS, ArmSpec, Payload, Robot
from armdyn.models.friction import FrictionValue
from armdyn.models.obstacles import Obstacle, load_obstacles, obstacle_from, pose_of
from armdyn.models.reaching import GoalPose
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
PayloadMass = Annotated[float, typer.Option("--payload", metavar="KG", help="Point mass that the arm carries \\[kg].")]
PayloadFrame = Annotated[
    str | None,
    typer.Option(metavar="LINK", help="Link or frame that the payload is fixed to; by default the tip, see doctor."),
]
PayloadCom = Annotated[
    str | None,
    typer.Option(metavar="X,Y,Z", help="The payload's centre of mass in that frame \\[m]; by default its origin."),
]
Lock = Annotated[
    list[str] | None,
    typer.Option(metavar="JOINT=Q", help="Fix a joint at a position \\[rad or m]; may be given again."),
]
Part = Annotated[
    str | None,
    typer.Option(
        "--arm",
        metavar="FIRST,LAST",
        help="Only the joints from one joint or link to another move, all else is locked; a last link is the tip.",
    ),
]
EffortLimit = Annotated[str | None, typer.Option(metavar="T[,T…]", help="Torque limits instead of the URDF's \\[N m].")]
VelocityLimit = Annotated[
    str | None, typer.Option(metavar="V[,V…]", help="Velocity limits instead of the URDF's \\[rad/s]; inf for none.")
]
Damping = Annotated[
    str | None,
    typer.Option(
        metavar="D[,D…]|urdf",
        help="Viscous friction: a joint loses D times its velocity \\[N m s/rad]. By default a URDF file's own, "
        "none for a library's robot, whose numbers are placeholders; urdf takes them.",
    ),
]
Friction = Annotated[
    str | None,
    typer.Option(
        metavar="F[,F…]|urdf",
        help="Coulomb friction: a joint loses F against its direction of motion \\[N m]. Default like --damping.",
    ),
]
FrictionWidth = Annotated[
    str | None,
    typer.Option(
        metavar="V",
        help="Coulomb friction is F tanh(v / V) \\[rad/s]: smaller is sharper, and slower to solve. Default 0.05.",
    ),
]
Armature = Annotated[
    str | None, typer.Option(metavar="J[,J…]", help="Rotor inertia seen at the joint, gear ratio² × rotor \\[kg m²].")
]
Out = Annotated[
    Path | None, typer.Option(metavar="DIR", help="Folder for the results. By default results/COMMAND-ROBOT.")
]
GoalPoseOption = Annotated[
    str | None,
    typer.Option(
        "--goal-pose",
        metavar="FRAME:X,Y,Z[,QX,QY,QZ,QW]",
        help="Instead of --q-goal: where a frame ends in the world \\[m], with its orientation as a quaternion if "
        "that matters. Inverse kinematics find the joint positions; the fastest to reach of several is kept.",
    ),
]
Via = Annotated[
    list[str] | None,
    typer.Option(metavar="Q,Q,…", help="Pose to pass through, at any time and speed; may be given again, in order."),
]
Obstacles = Annotated[
    list[str] | None,
    typer.Option(
        "--obstacle",
        metavar="SHAPE|FILE.json",
        help="Something to keep clear of, in the world \\[m]: box:SX,SY,SZ@X,Y,Z (edges, centre), sphere:R@X,Y,Z, "
        "capsule:R@X,Y,Z;X,Y,Z, or a file of them, boxes turned too (docs/obstacles.md). May be given again.",
    ),
]
SelfCollision = Annotated[bool, typer.Option("--self-collision", help="Keep the arm's links clear of each other, too.")]
ClearanceOption = Annotated[
    float, typer.Option("--clearance", metavar="M", help="From obstacles, and between links \\[m].")
]
AccelerationLimit = Annotated[
    str | None, typer.Option(metavar="A[,A…]", help="Acceleration limits \\[rad/s²]; by default none.")
]
JerkLimit = Annotated[
    str | None,
    typer.Option(metavar="J[,J…]", help="Jerk limits \\[rad/s³]: the torque no longer jumps. By default none."),
]
Wrap = Annotated[
    bool,
    typer.Option(
        "--wrap",
        help="Goals of endless joints (continuous: no position limits) count modulo 2π: take the faster way round.",
    ),
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


def friction_values(text: str | None, what: str) -> FrictionValue | None:
    """One number for all joints, one for each, or the URDF's."""
    return "urdf" if text is not None and text.strip() == "urdf" else one_or_more(text, what)


def obstacles_of(texts: Sequence[str] | None) -> tuple[Obstacle, ...]:
    """Obstacles as --obstacle says them.

    Raises:
        ProblemError: a text is no shape and no file, or the file has none.
    """
    found: list[Obstacle] = []
    for text in texts or ():
        kind, colon, rest = text.partition(":")
        if not colon or kind not in ("box", "sphere", "capsule"):
            found += load_obstacles(text)
            continue
        what = f"--obstacle {text}"
        sizes, _, places = rest.partition("@")
        values, at = numbers(sizes, what), [numbers(place, what) for place in places.split(";")]
        if (len(values), len(at)) != ((3, 1) if kind == "box" else (1, 2) if kind == "capsule" else (1, 1)):
            raise ProblemError(f"{what}: write box:SX,SY,SZ@X,Y,Z or sphere:R@X,Y,Z or capsule:R@X,Y,Z;X,Y,Z")
        if kind == "box":
            entry: dict[str, object] = {"size": values, "position": at[0]}
        elif kind == "sphere":
            entry = {"radius": values[0], "center": at[0]}
        else:
            entry = {"radius": values[0], "a": at[0], "b": at[1]}
        found.append(obstacle_from({"type": kind, **entry}, what))
    return tuple(found)


def goal_pose_of(text: str) -> GoalPose:
    """A goal pose as --goal-pose says it.

    Raises:
        ProblemError: it is none.
    """
    frame, colon, rest = text.rpartition(":")
    values = numbers(rest, "--goal-pose") if colon and frame else []
    if len(values) not in (3, 7):
        raise ProblemError(f"--goal-pose {text!r}: write FRAME:X,Y,Z or FRAME:X,Y,Z,QX,QY,QZ,QW")
    if len(values) == 3:
        return GoalPose(frame, values)
    return GoalPose(frame, pose_of(values[:3], values[3:], None, "--goal-pose"))


def carried(mass: float, frame: str | None, com: str | None) -> Payload | None:
    """The payload that the options describe.

    Raises:
        ProblemError: where it is, but not what it weighs.
    """
    if not mass and (frame or com):
        raise ProblemError("--payload-frame and --payload-com say where a payload is: give its mass, --payload KG")
    centre = (0.0, 0.0, 0.0) if com is None else numbers(com, "--payload-com")
    return Payload(mass=mass, frame=frame, com=centre) if mass else None


def load_robot(
    name: str,
    payload: Payload | None = None,
    lock: Sequence[str] | None = None,
    effort_limit: str | None = None,
    velocity_limit: str | None = None,
    damping: str | None = None,
    friction: str | None = None,
    friction_width: str | None = None,
    armature: str | None = None,
    part: str | None = None,
) -> Robot:
    """The robot that a command names.

    Raises:
        ArmdynError: there is none of that name, or an option does not fit it.
    """
    limits = (
        one_or_more(effort_limit, "--effort-limit"),
        one_or_more(velocity_limit, "--velocity-limit"),
    )
    if name in PAPER_ARMS:
        if lock or part:
            option = "--lock" if lock else "--arm"
            raise SpecError(f"{option}: {name!r} has no joints to lock; it takes a URDF file or a library's robot")
        robot = Robot.from_spec(ArmSpec.paper(name), payload)
    else:
        robot = _read(name, payload, lock, part)
    return (
        robot.with_limits(*limits)
        .with_armature(one_or_more(armature, "--armature"))
        .with_friction(
            friction_values(damping, "--damping"),
            friction_values(friction, "--friction"),
            None if friction_width is None else number(friction_width, "--friction-width"),
        )
    )


def friction_facts(robot: Robot) -> dict[str, object]:
    """The friction in a robot's joints, for machines; empty if there is none."""
    own = robot.friction
    if not own.present:
        return {}
    damping, coulomb = (np.broadcast_to(np.asarray(x), robot.nv).tolist() for x in (own.damping, own.coulomb))
    return {"damping": damping, "friction": coulomb, "friction_width": own.width}


def friction_words(robot: Robot) -> dict[str, str]:
    """The same for people."""
    facts = friction_facts(robot)
    if not facts:
        return {}

    def each(values: object) -> str:
        unique = dict.fromkeys(f"{x:.4g}" for x in np.ravel(np.asarray(values)))
        return next(iter(unique)) if len(unique) == 1 else ", ".join(f"{x:.4g}" for x in np.ravel(np.asarray(values)))

    text = f"viscous {each(facts['damping'])} N m s/rad, Coulomb {each(facts['friction'])} N m"
    return {"joint friction": f"{text} (over {robot.friction.width:g} rad/s)"}


def _read(name: str, payload: Payload | None, lock: Sequence[str] | None, part: str | None) -> Robot:
    """A URDF file or a library's robot."""
    locks: dict[str, float] | None = None
    if lock:
        pairs = [text.partition("=") for text in lock]
        locks = {joint: number(value, f"--lock {joint}") for joint, _, value in pairs}
    arm: tuple[str, str] | None = None
    if part is not None:
        first, comma, last = (text.strip() for text in part.partition(","))
        if not (first and comma and last):
            raise SpecError(f"--arm: {part!r} is not FIRST,LAST: two joints or links with a comma between")
        arm = first, last
    if Path(name).suffix or Path(name).is_file():
        return Robot.from_urdf(name, payload, locks, arm=arm)
    return Robot.from_library(name, payload, locks, arm=arm)


def poses(
    robot: Robot, name: str, kind: Kind, q_start: str | None, q_goal: str | None, *, posed: bool = False
) -> list[list[float]]:
    """Start and goal: what is given, else the paper's example; the start alone if the goal is given as a pose.

    Raises:
        ProblemError: neither.
    """
    chosen = []
    if posed and q_goal is not None:
        raise ProblemError("--q-goal and --goal-pose both say where to: give one of them")
    for option, text in (("--q-start", q_start), ("--q-goal", q_goal))[: 1 if posed else 2]:
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
