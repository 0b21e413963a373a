"""Options of positions and poses: with units and names of poses, starts and goals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import armdyn as ad
from armdyn import models
from armdyn.cli.invocation import flag_of, option_value
from armdyn.cli.options.groups import TASK, Numbers, flag, group, option
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import FREE, has_unit, numbers
from armdyn.parsing.numbers import position as typed_position

if TYPE_CHECKING:
    from armdyn.paper import Kind

End = Literal["q_start", "q_goal"]
ENDS: tuple[End, End] = ("q_start", "q_goal")


def degrees_are_on() -> bool:
    """Whether angles without a unit are in degrees: --degrees."""
    return bool(option_value("degrees"))


def position(text: str, what: str, slides: bool | None = False) -> float:
    """A joint's position [rad or m], as `armdyn.parsing.numbers.position` reads it; with --degrees in degrees."""
    return typed_position(text, what, slides, degrees=degrees_are_on())


def positions(text: str, what: str, robot: ad.Robot) -> list[float]:
    """The positions of all joints [rad or m]: numbers with commas between, or the name of one of the robot's poses.

    Raises:
        ProblemError: it is neither.
    """
    from armdyn.models.robots.poses import positions_of

    return positions_of(robot, text, what, degrees=degrees_are_on())


def check_units_of_sliding_locks(texts: Sequence[str], robot: ad.Robot) -> None:
    """Refuse --degrees for a sliding joint that is locked without a unit: JOINT=0.1.

    Args:
        texts: of --lock.
        robot: with these joints locked, which are then no joints of its model any more.

    Raises:
        ProblemError: there is such a joint; or the robot is not from a URDF, so that its joints' kinds are unknown.
    """
    pairs = [text.partition("=") for text in texts]
    bare = [joint for joint, _, value in pairs if not has_unit(value) and value.strip() != FREE]
    if not (bare and degrees_are_on()):
        return
    if not robot.urdf:
        raise ProblemError(f"--lock {bare[0]}: say the unit, such as 90deg or 0.1m: {robot.source} is no URDF")
    from armdyn.models.reading.urdf_xml import parse_xml

    for joint in parse_xml(robot.urdf, robot.source).iterfind("joint"):
        if joint.get("name") in bare and joint.get("type") == "prismatic":
            raise ProblemError(f"--lock {joint.get('name')}: the joint slides, --degrees is of angles: write 0.1m")


@group(TASK)
class PoseOptions:
    """Start and goal as joint positions [rad or m], each as text."""

    q_start: str | None = option(
        "Q,Q,…|NAME",
        "Start: a position per joint \\[rad or m]; pi/20 and 90deg work; or the name of a pose, which armdyn "
        "robots ROBOT lists. r, rr, rrr: the paper's.",
    )
    q_goal: str | None = option("Q,Q,…|NAME", "Goal, like --q-start.")

    def end(self, which: End, robot: ad.Robot, name: str, kind: Kind = "minimum_time") -> list[float]:
        """Joint positions at the start or the goal; of r, rr and rrr by default those of the paper's example.

        Args:
            which: the option.
            robot: that moves.
            name: of the robot, as the user gave it.
            kind: of the example.

        Raises:
            ProblemError: the option is malformed, or missing; see `default`.
        """
        if (text := getattr(self, which)) is not None:
            return positions(text, flag_of(which), robot)
        if name not in models.PLANAR_ARMS:
            return self.default(which, robot, name)
        from armdyn.paper import example

        return list(getattr(example(name, kind), which))

    def default(self, which: End, robot: ad.Robot, name: str) -> list[float]:
        """Joint positions where an option is not given.

        Raises:
            ProblemError: there are none by default.
        """
        option, poses = flag_of(which), ", ".join(robot.poses)
        names = f", or a pose that has a name ({poses})" if poses else ""
        example = ",".join(["0", "90deg", "0.5"][: robot.nv] + ["0"] * (robot.nv - 3))
        raise ProblemError(
            f"give {option} for {robot.name}: {robot.nv} positions with commas between [rad or m; 90deg works]{names}; "
            f"such as {option}={example}, in the order {', '.join(robot.joint_names)}"
        )

    def problem_arguments(self, robot: ad.Robot, name: str) -> dict[str, Any]:
        """Start and goal as arguments of a `MinimumTimeProblem`; arguments and errors as of `end`."""
        return {which: self.end(which, robot, name) for which in ENDS}


@group()
class GoalOptions(PoseOptions):
    """Start and goal, which may be a frame's pose; joint velocities there; turns of endless joints.

    Attributes:
        goal_pose: instead of a goal as joint positions; goal_free, goal_tolerance: the region around it.
        v_start: velocities at the start [rad/s or m/s], shape (nv,); v_goal: at the goal.
        wrap: goals of endless joints count modulo 2π.
    """

    goal_pose: str | None = option(
        "FRAME:X,Y,Z[,QX,QY,QZ,QW]",
        "Instead of --q-goal: where a frame ends in the world \\[m], with its orientation as a quaternion if "
        "that matters. Inverse kinematics find the joint positions; the fastest to reach of several is kept.",
    )
    goal_free: str | None = option(
        "AXIS,…",
        "Directions in which --goal-pose is free, of x, y, z, rx, ry, rz along its own axes: rz lets a tool turn about "
        "its z axis. The fastest end is chosen.",
    )
    goal_tolerance: Numbers = option(
        "X,Y,Z,RX,RY,RZ", "Tolerance of --goal-pose in either direction, along and about its own axes \\[m, rad]."
    )
    v_start: Numbers = option("V,V,…", "Joint velocities at the start \\[rad/s or m/s]; by default it is at rest.")
    v_goal: Numbers = option("V,V,…", "Joint velocities at the goal, like --v-start.")
    wrap: bool = flag(
        "Goals of endless joints (continuous: no position limits) count modulo 2π: take the faster way round."
    )

    def problem_arguments(self, robot: ad.Robot, name: str) -> dict[str, Any]:
        """Start and goal as arguments of a `MinimumTimeProblem`.

        Args:
            robot: that moves.
            name: of the robot, as the user gave it.

        Raises:
            ProblemError: a text is no pose, one is missing, or the goal is given twice.
        """
        if self.goal_pose is not None and self.q_goal is not None:
            raise ProblemError("--q-goal and --goal-pose both say where to: give one of them")
        if self.goal_pose is None and (self.goal_free or self.goal_tolerance):
            raise ProblemError("--goal-free and --goal-tolerance belong to --goal-pose, which is not given")
        from armdyn.optimal.problem.poses import endless

        if self.wrap and not endless(robot, robot.limits).any():
            raise ProblemError(
                f"--wrap is about endless joints; all joints of {robot.name} slide or have position limits"
            )
        goal = None if self.goal_pose is None else goal_pose_of(self.goal_pose)
        if goal is not None:
            free = tuple(part.strip() for part in self.goal_free.split(",")) if self.goal_free else ()
            try:
                goal = replace(goal, free=free, tolerance=tuple(self.goal_tolerance or ()))
            except ProblemError as error:
                raise ProblemError(f"--goal-free or --goal-tolerance: {error}") from error
        return {
            "q_start": self.end("q_start", robot, name),
            "q_goal": self.end("q_goal", robot, name) if goal is None else None,
            "goal_pose": goal,
            "v_start": self.v_start,
            "v_goal": self.v_goal,
            "wrap": self.wrap,
        }


def goal_pose_of(text: str) -> ad.GoalPose:
    """Parse a goal pose of --goal-pose.

    Raises:
        ProblemError: the text is no goal pose.
    """
    from armdyn.models.values.placement import pose_of

    frame, colon, rest = text.rpartition(":")
    values = numbers(rest, "--goal-pose") if colon and frame else []
    if len(values) not in (3, 7):
        raise ProblemError(f"--goal-pose {text!r}: write FRAME:X,Y,Z or FRAME:X,Y,Z,QX,QY,QZ,QW")
    if len(values) == 3:
        return ad.GoalPose(frame, values)
    return ad.GoalPose(frame, pose_of(values[:3], values[3:], None, "--goal-pose"))
