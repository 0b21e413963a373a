"""A minimum-time problem as a command is asked for it: by its options, or by a problem file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import armdyn as ad
from armdyn.cli.options.course import CourseOptions
from armdyn.cli.options.joints import FastJointOptions
from armdyn.cli.options.poses import GoalOptions
from armdyn.cli.options.robot import PayloadOptions, RobotOptions
from armdyn.cli.typed.problem_file import is_problem_file, problem_of, refuse_beside_a_file


def problem_asked(
    robot: RobotOptions, goal: GoalOptions, payload: PayloadOptions, joints: FastJointOptions, course: CourseOptions
) -> tuple[ad.MinimumTimeProblem, Mapping[str, Any]]:
    """The problem that the command line asks, or a problem file; and the solver's options that a file has.

    Raises:
        ArmdynError: there is no such problem; or the command line says again what a file says.
    """
    if is_problem_file(robot.robot):
        refuse_beside_a_file(robot.robot, goal, payload, robot.part, joints, course)
        posed = problem_of(robot.robot)
        return posed.problem, posed.options
    arm = joints.fit(robot.read(payload.carried()))
    asked = {**goal.asked(arm, robot.robot), **joints.kept(), **course.asked(arm)}
    return ad.MinimumTimeProblem(arm, **asked), {}
