"""What a command is asked for, by its options or by a problem file: a minimum-time problem, or an arm and its poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import armdyn as ad
from armdyn.cli.options.course import PathConstraintOptions
from armdyn.cli.options.joints import FastJointOptions, JointOptions
from armdyn.cli.options.poses import GoalOptions, PoseOptions
from armdyn.cli.options.robot import PayloadOptions, RobotArgument
from armdyn.cli.parsing.problem_file import is_problem_file, problem_file, refuse_beside_a_file
from armdyn.errors import ProblemError

if TYPE_CHECKING:
    from armdyn.optimal.problem_files import ProblemFile
    from armdyn.paper import Kind


def requested_problem(
    robot: RobotArgument,
    goal: GoalOptions,
    payload: PayloadOptions,
    joints: FastJointOptions,
    course: PathConstraintOptions,
) -> tuple[ad.MinimumTimeProblem, Mapping[str, Any]]:
    """The problem that the command line asks, or a problem file; and the solver's options that a file has.

    Raises:
        ArmdynError: there is no such problem; or the command line says again what a file says.
    """
    if is_problem_file(robot.robot):
        refuse_beside_a_file(robot.robot, goal, payload, robot.part, joints, course)
        file = problem_file(robot.robot)
        return file.made(), file.options
    arm = joints.fit(robot.read(payload.carried()))
    asked = {**goal.problem_arguments(arm, robot.robot), **joints.problem_arguments(), **course.problem_arguments(arm)}
    return ad.MinimumTimeProblem(arm, **asked), {}


@dataclass(frozen=True)
class ArmRequest:
    """An arm, and from where to where it is to move.

    Attributes:
        arm: as a controller knows it.
        robot: its name, and which of its joints move.
        poses: of the command line.
        payload: likewise.
        joints: likewise.
        file: the problem file; None: the command line says all.
        problem: of the file.
    """

    arm: ad.Robot
    robot: RobotArgument
    poses: PoseOptions
    payload: PayloadOptions
    joints: JointOptions | FastJointOptions
    file: ProblemFile | None = None
    problem: ad.MinimumTimeProblem | None = None

    def carrying(self, mass: float | None) -> ad.Robot:
        """The same arm with another mass [kg] where its payload is; None: with its own."""
        if self.file is not None:
            return self.file.made_robot(mass)
        return self.joints.fit(
            self.robot.read(self.payload.place.carried(self.payload.payload if mass is None else mass))
        )

    def ends(self, kind: Kind = "minimum_time") -> tuple[list[float], list[float]]:
        """Start and goal [rad or m], between which the arm goes from rest to rest.

        Args:
            kind: of the paper's example whose poses r, rr and rrr have by default.

        Raises:
            ProblemError: one is missing, or a problem file asks for more than that.
        """
        if self.problem is None:
            return self.poses.start(self.arm, self.robot.robot, kind), self.poses.goal(self.arm, self.robot.robot, kind)
        import numpy as np

        problem, name = self.problem, self.robot.robot
        if np.any(problem.v_start) or np.any(problem.v_goal):
            raise ProblemError(f"{name} has v_start or v_goal; here the arm goes from rest to rest")
        return np.asarray(problem.q_start).tolist(), np.asarray(problem.q_goal).tolist()

    def fastest(self) -> tuple[ad.MinimumTimeProblem, ad.MinimumTimeOptions]:
        """The fastest motion as a problem, and how it is searched.

        Raises:
            ArmdynError: there is no such problem.
        """
        if self.file is not None and self.problem is not None:
            return self.problem, ad.MinimumTimeOptions(**self.file.options)
        start, goal = self.ends()
        kept = self.joints.problem_arguments() if isinstance(self.joints, FastJointOptions) else {}
        return ad.MinimumTimeProblem(self.arm, q_start=start, q_goal=goal, **kept), ad.MinimumTimeOptions()


def requested_arm(
    robot: RobotArgument, poses: PoseOptions, payload: PayloadOptions, joints: JointOptions | FastJointOptions
) -> ArmRequest:
    """The arm that the command line names, or a problem file.

    Raises:
        ArmdynError: there is no such arm; or the command line says again what a file says.
    """
    if is_problem_file(robot.robot):
        refuse_beside_a_file(robot.robot, poses, payload, robot.part, joints)
        file = problem_file(robot.robot)
        problem = file.made()
        return ArmRequest(problem.robot, robot, poses, payload, joints, file, problem)
    arm = joints.fit(robot.read(payload.carried()))
    return ArmRequest(arm, robot, poses, payload, joints)
