"""Options of the joints: limits, friction, rotor inertia."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

import armdyn as ad
from armdyn.arguments import shown
from armdyn.cli.options.groups import LIMITS, ROBOT, PerJoint, group, option
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import numbers, one_or_more
from armdyn.reprs import joint_unit

if TYPE_CHECKING:
    from armdyn.models.values.friction import FrictionValue


def _friction(text: str, what: str) -> FrictionValue:
    """Parse friction: one number for all joints, one per joint, or "urdf" for the URDF's."""
    return "urdf" if text.strip() == "urdf" else one_or_more(text, what)


_Friction: TypeAlias = Annotated[float | list[float] | dict[str, float] | Literal["urdf"] | None, _friction]


@group(ROBOT)
class JointOptions:
    """Torque limits, friction and rotor inertia; None leaves the robot's own."""

    effort_limit: PerJoint = option(
        "T[,T…]",
        "Torque limits instead of the URDF's \\[N m or N]; 0: a joint has no motor. One number, one per joint, or "
        "JOINT=T of some, such as elbow=12,wrist=3; may be given again. So are all options of numbers per joint.",
        rich_help_panel=LIMITS,
    )
    damping: _Friction = option(
        "D[,D…]|urdf",
        "Viscous friction: a joint loses D times its velocity \\[N m s/rad or N s/m]. By default a URDF file's own, "
        "none for a library's robot, whose numbers are placeholders; urdf takes them.",
    )
    friction: _Friction = option(
        "F[,F…]|urdf",
        "Coulomb friction: a joint loses F against its direction of motion \\[N m or N]. Default like --damping.",
    )
    friction_width: PerJoint = option(
        "V[,V…]",
        "Coulomb friction is F tanh(v / V) \\[rad/s or m/s]: smaller is sharper, and slower to solve. Default 0.05.",
    )
    torque_speed: list[str] | None = option(
        "JOINT=V:T,V:T…",
        "Torque-speed curve of a joint's motor: speeds from 0 on \\[rad/s or m/s], the largest driving torques there "
        "\\[N m or N], linear between and concave; it brakes with its whole torque limit. May be given again.",
        rich_help_panel=LIMITS,
    )
    armature: PerJoint = option("J[,J…]", "Rotor inertia seen at the joint, gear ratio² × rotor \\[kg m²].")
    rotor_inertia: PerJoint = option("J[,J…]", "Inertia of the rotors themselves \\[kg m²], with --gear-ratio.")
    gear_ratio: PerJoint = option("N[,N…]", "Turns of the rotor for one of the joint, with --rotor-inertia.")

    def fit(self, robot: ad.Robot) -> ad.Robot:
        """A robot with these joints.

        Raises:
            ArmdynError: an option does not fit it.
        """
        return (
            robot.with_limits(self.effort_limit, None)
            .with_torque_speed(_curves(self.torque_speed))
            .with_armature(self.armature, self.rotor_inertia, self.gear_ratio)
            .with_friction(self.damping, self.friction, self.friction_width)
        )


@group(LIMITS)
class FastJointOptions:
    """Options of the joints of a minimum-time motion: velocity limits, reserves, joints without a motor."""

    velocity_limit: PerJoint = option("V[,V…]", "Velocity limits instead of the URDF's \\[rad/s or m/s]; inf for none.")
    reserve: PerJoint = option(
        "R[,R…]",
        "Part of the torque limits that is kept for feedback: with 0.1 the motion uses 90 % at most.",
        default="0",
    )
    velocity_reserve: PerJoint = option("R[,R…]", "Part of the velocity limits that is kept, likewise.", default="0")
    passive: list[str] | None = option(
        "JOINT",
        "A joint without a motor, such as a cart's pole: its torque is zero, and the other joints swing it "
        "where it is to go. The same as a limit of 0 in --effort-limit; may be given again. A zero in a URDF does "
        "not mean that: in many it stands for an unknown limit.",
        rich_help_panel=ROBOT,
    )
    joints: JointOptions

    def fit(self, robot: ad.Robot) -> ad.Robot:
        """A robot with these joints; see `JointOptions.fit`."""
        return self.joints.fit(robot.with_limits(None, self.velocity_limit)).with_passive(self.passive or ())

    def problem_arguments(self) -> dict[str, Any]:
        """The reserves of a `MinimumTimeProblem`, as its arguments."""
        return {"reserve": self.reserve, "velocity_reserve": self.velocity_reserve}


def reserve_words(problem: ad.MinimumTimeProblem) -> dict[str, str]:
    """Reserves for feedback, in words; empty without one."""
    kept = problem.reserves
    shares = [
        f"{words[0] if len(set(words)) == 1 else ', '.join(words)} of the {limit} limits"
        for parts, limit in ((kept.effort, "torque"), (kept.velocity, "velocity"))
        if any(parts) and (words := [f"{100 * part:.3g} %" for part in parts])
    ]
    return {"kept for feedback": "; ".join(shares)} if shares else {}


def _curves(texts: list[str] | None) -> dict[str, list[list[float]]] | None:
    """Parse the options of torque-speed curves, by joint name; None without such an option."""
    curves: dict[str, list[list[float]]] = {}
    for text in texts or ():
        name, _, points = text.partition("=")
        if name.strip() in curves:
            raise ProblemError(
                f"--torque-speed: joint {shown(name.strip())} is given twice; give it once, with all points"
            )
        curves[name.strip()] = [
            numbers(point.replace(":", ","), f"--torque-speed {name.strip()}") for point in points.split(",")
        ]
    return curves or None


def friction_facts(robot: ad.Robot) -> dict[str, object]:
    """The friction in a robot's joints as JSON; empty if there is none."""
    own = robot.friction
    if not own.present:
        return {}
    damping, coulomb = own.per_joint(robot.nv)
    return {"damping": damping.tolist(), "friction": coulomb.tolist(), "friction_width": own.listed_width}


def friction_words(robot: ad.Robot) -> dict[str, str]:
    """The friction in a robot's joints in words; empty if there is none."""
    own = robot.friction
    if not own.present:
        return {}
    width = own.listed_width
    widths = width if isinstance(width, list) else [width]
    each = [[f"{x:.4g}" for x in values] for values in (*own.per_joint(robot.nv), widths)]
    damping, coulomb, over = (words[0] if len(set(words)) == 1 else ", ".join(words) for words in each)
    viscous, dry, speed = (
        joint_unit(robot.slides, *units) for units in (("N m s/rad", "N s/m"), ("N m", "N"), ("rad/s", "m/s"))
    )
    return {"joint friction": f"viscous {damping} {viscous}, Coulomb {coulomb} {dry} (over {over} {speed})"}


def carried_facts(robot: ad.Robot) -> dict[str, object]:
    """The tip and the payload, for JSON."""
    bodies = [
        {"name": body.name, "mass": body.mass, "frame": robot.frame_of(body).name, "com": list(body.com)}
        | {"shapes": len(body.shapes)}
        for body in robot.attached
    ]
    return {"tip": robot.tip, "carried": bodies}


def carried_words(robot: ad.Robot, goal: ad.GoalPose | None = None) -> dict[str, str]:
    """The tip, and the payload with its place, in words.

    Args:
        robot: the arm.
        goal: of its motion; a payload by default in another frame is said to be so.
    """
    lines = []
    for body in robot.attached:
        size = f", {len(body.shapes)} shape{'s' if len(body.shapes) > 1 else ''}" if body.shapes else ""
        at = f" at ({', '.join(f'{x:g}' for x in body.com)}) m" if any(body.com) else ""
        lines.append(f"{body.name} of {body.mass:g} kg{at} in the frame {robot.frame_of(body).name!r}{size}")
    if goal and robot.payload and not robot.payload.frame and not robot.same_place(robot.tip, goal.frame):
        lines[-1] += (
            f"; the goal is one of {goal.frame!r}, placed otherwise: --payload-frame {goal.frame} puts it there"
        )
    words = {"tip": repr(robot.tip)} | ({"carries": "\n".join(lines)} if lines else {})
    if robot.has_dynamics and not robot.model.inertias[robot.nv].mass:
        words["no mass"] = f"{robot.joint_names[-1]} turns a rotor alone: torques leave its links out"
    return words
