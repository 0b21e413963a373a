"""The task of a command, by its options or a problem file: a minimum-time problem, or an arm and its poses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import armdyn as ad
from armdyn.cli.options.groups import given
from armdyn.cli.options.joints import FastJointOptions, JointOptions
from armdyn.cli.options.path_constraints import PathConstraintOptions
from armdyn.cli.options.poses import GoalOptions, PoseOptions
from armdyn.cli.options.positions import degrees_are_on
from armdyn.cli.options.preset import PresetOptions
from armdyn.cli.options.robot import PayloadOptions, RobotArgument, kind_of_file, only_in_the_file
from armdyn.errors import ProblemError
from armdyn.locks import cached_property

if TYPE_CHECKING:
    from armdyn.optimal.problem_files import ProblemFile
    from armdyn.paper import Kind


def problem_file(name: str) -> ProblemFile:
    """The tables of a problem file.

    Raises:
        ProblemError: it cannot be read.
    """
    from armdyn.optimal.problem_files import read_problem_file

    return read_problem_file(name)


def likely_arms(task: ProblemOptions | ArmOptions) -> tuple[ad.Robot, ...]:
    """The likely arms of a file of `armdyn identify`, with the options' payload and limits; empty for other robots.

    Raises:
        ArmdynError: one of them cannot be made.
    """
    name = task.robot.robot
    if not name.lower().endswith(".toml"):
        return ()
    from armdyn.optimal.problem.robot_tables import likely_from
    from armdyn.parsing.toml import read_toml

    carried, arms = task.payload.carried(), likely_from(read_toml(name).table("robot"))
    return tuple(task.joints.fit(arm if carried is None else arm.with_payload(carried)) for arm in arms)


def refuse_with_a_file(name: str, *groups: Any) -> None:
    """Refuse options that a problem file or a study file sets itself.

    Args:
        name: the file.
        groups: of such options, as they were given.

    Raises:
        ProblemError: one of them is not as by default; or --degrees was given.
    """
    if degrees_are_on():
        raise ProblemError(f"--degrees: {name} has its own units: 1.57, or '90deg'")
    for option in given(*groups):
        raise only_in_the_file(option, name)


@dataclass(frozen=True, kw_only=True)
class ProblemOptions:
    """A minimum-time problem, or a problem file instead of a robot."""

    goal: GoalOptions
    payload: PayloadOptions
    robot: RobotArgument
    joints: FastJointOptions
    controller: PresetOptions
    path_constraints: PathConstraintOptions

    def problem(self) -> tuple[ad.MinimumTimeProblem, Mapping[str, Any]]:
        """The problem, and the solver's options of a file.

        Raises:
            ArmdynError: the problem is ill-posed; or an option repeats a key of the file.
        """
        name = self.robot.robot
        if kind_of_file(name) in ("problem", "study"):
            refuse_with_a_file(name, self)
            file = problem_file(name)
            return file.new_problem(), file.options
        arm = self.joints.fit(self.robot.read(self.payload.carried()))
        ends = self.goal.problem_arguments(arm, name) | self.joints.problem_arguments()
        kept = self.path_constraints.problem_arguments(arm)
        return ad.MinimumTimeProblem(arm, **ends, **kept, preset=self.controller.read()), {}


@dataclass(frozen=True, kw_only=True)
class ArmOptions:
    """Options of a rest-to-rest motion: robot or problem file, start and goal."""

    poses: PoseOptions
    payload: PayloadOptions
    robot: RobotArgument
    joints: JointOptions

    @cached_property
    def file(self) -> ProblemFile | None:
        """The problem file; None: a robot is named instead.

        Raises:
            ArmdynError: it cannot be read; or an option repeats one of its keys.
        """
        name = self.robot.robot
        if kind_of_file(name) not in ("problem", "study"):
            return None
        refuse_with_a_file(name, self)
        return problem_file(name)

    @cached_property
    def arm(self) -> ad.Robot:
        """The controller's model of the arm.

        Raises:
            ArmdynError: the arm cannot be read.
        """
        return self.carrying(None) if self._problem is None else self._problem.robot

    @cached_property
    def _problem(self) -> ad.MinimumTimeProblem | None:
        return None if self.file is None else self.file.new_problem()

    def carrying(self, mass: float | None) -> ad.Robot:
        """The arm with another mass [kg] where its payload is; None: with its own."""
        if self.file is not None:
            return self.file.new_robot(mass)
        return self.joints.fit(
            self.robot.read(self.payload.place.carried(self.payload.payload if mass is None else mass))
        )

    def ends(self, kind: Kind = "minimum_time") -> tuple[list[float], list[float]]:
        """Start and goal [rad or m].

        Args:
            kind: of the paper's example whose poses r, rr and rrr have by default.

        Raises:
            ProblemError: one is missing, or a problem file has velocities there.
        """
        problem, name = self._problem, self.robot.robot
        if problem is None:
            return self.poses.start(self.arm, name, kind), self.poses.goal(self.arm, name, kind)
        import numpy as np

        if np.any(problem.v_start) or np.any(problem.v_goal):
            raise ProblemError(f"{name} has v_start or v_goal; here the arm goes from rest to rest")
        return np.asarray(problem.q_start).tolist(), np.asarray(problem.q_goal).tolist()


@dataclass(frozen=True, kw_only=True)
class FastArmOptions(ArmOptions):
    """An arm from pose to pose, with the limits of its fastest motion."""

    joints: FastJointOptions  # type: ignore[assignment]  # it fits a robot, too

    def fastest(self) -> tuple[ad.MinimumTimeProblem, ad.MinimumTimeOptions]:
        """The fastest motion as a problem, and how it is searched.

        Raises:
            ArmdynError: the problem is ill-posed.
        """
        if self.file is not None and self._problem is not None:
            return self._problem, ad.MinimumTimeOptions(**self.file.options)
        start, goal = self.ends()
        kept = self.joints.problem_arguments()
        return ad.MinimumTimeProblem(self.arm, q_start=start, q_goal=goal, **kept), ad.MinimumTimeOptions()
