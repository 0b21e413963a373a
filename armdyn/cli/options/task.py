"""The task of a command, by its options or a problem file: a minimum-time problem, or an arm and its poses."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import armdyn as ad
from armdyn.cli.options.groups import given, group
from armdyn.cli.options.joints import FastJointOptions, JointOptions
from armdyn.cli.options.path_constraints import PathConstraintOptions, PresetOptions
from armdyn.cli.options.poses import ENDS, GoalOptions, PoseOptions, degrees_are_on
from armdyn.cli.options.robot import PayloadOptions, RobotArgument, kind_of_file, only_in_the_file
from armdyn.errors import ProblemError
from armdyn.locks import cached_property

if TYPE_CHECKING:
    from armdyn.optimal.problem_files import ProblemFile
    from armdyn.paper import Kind


def refuse_with_a_file(name: str, *groups: Any, but: Collection[str] = ()) -> None:
    """Refuse options that a problem file or a study file sets itself.

    Args:
        name: the file.
        groups: of such options.
        but: names of those that are allowed.

    Raises:
        ProblemError: one of them is given; or --degrees is.
    """
    if degrees_are_on():
        raise ProblemError(f"--degrees: {name} has its own units: 1.57, or '90deg'")
    for option in given(*groups):
        if option not in but:
            raise only_in_the_file(option, name)


@group()
class ArmOptions:
    """Options of a motion: a robot with start and goal, or a problem file instead of the robot.

    Attributes:
        besides_a_file: names of the options that may be given with a problem file, too.
    """

    besides_a_file: ClassVar[Collection[str]] = ()

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
        from armdyn.optimal.problem_files import read_problem_file

        refuse_with_a_file(name, self, but=self.besides_a_file)
        return read_problem_file(name)

    @cached_property
    def arm(self) -> ad.Robot:
        """The controller's model of the arm.

        Raises:
            ArmdynError: the arm cannot be read.
        """
        return self.carrying(None)

    @cached_property
    def of_file(self) -> ad.MinimumTimeProblem | None:
        """The problem of the file; None: a robot is named instead."""
        return None if self.file is None else self.file.new_problem()

    @property
    def likely(self) -> tuple[ad.Robot, ...]:
        """The likely arms of a file of `armdyn identify`, with the options' payload and limits; empty: none.

        Raises:
            ArmdynError: one of them cannot be made.
        """
        if not self.robot.robot.lower().endswith(".toml"):
            return ()
        from armdyn.models.tables import likely_from
        from armdyn.parsing.toml import read_toml

        carried, arms = self.payload.carried(), likely_from(read_toml(self.robot.robot).table("robot"))
        return tuple(self.joints.fit(arm if carried is None else arm.with_payload(carried)) for arm in arms)

    def carrying(self, mass: float | None) -> ad.Robot:
        """The arm with another mass [kg] where its payload is; None: with its own.

        It has the whole limits of a problem file: the reserve is for feedback.
        """
        if self.file is not None and self.of_file is not None:
            limits = self.of_file.variant(reserve=0.0, velocity_reserve=0.0).limits
            return replace(self.file.new_robot(mass), limits=limits)
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
        problem, name = self.of_file, self.robot.robot
        if problem is None:
            start, goal = (self.poses.end(which, self.arm, name, kind) for which in ENDS)
            return start, goal
        import numpy as np

        if np.any(problem.v_start) or np.any(problem.v_goal):
            raise ProblemError(f"{name} has v_start or v_goal; here the arm goes from rest to rest")
        return np.asarray(problem.q_start).tolist(), np.asarray(problem.q_goal).tolist()


@group()
class FastArmOptions(ArmOptions):
    """Options of a fastest motion: an arm from pose to pose, with limits."""

    joints: FastJointOptions  # type: ignore[assignment]  # it fits a robot, too

    def problem(self, mass: float | None = None) -> ad.MinimumTimeProblem:
        """The minimum-time problem.

        Args:
            mass: of the payload instead of the option's or the file's [kg].

        Raises:
            ArmdynError: the problem is ill-posed; or an option repeats a key of the file.
        """
        if self.file is not None:
            return self.file.new_problem(mass)
        arm = self.carrying(mass)
        return ad.MinimumTimeProblem(arm, **self.conditions(arm))

    def conditions(self, arm: ad.Robot) -> dict[str, Any]:
        """Arguments of the problem besides the arm."""
        return self.poses.problem_arguments(arm, self.robot.robot) | self.joints.problem_arguments()

    @property
    def solver_options(self) -> Mapping[str, Any]:
        """The solver's options of a problem file; empty where a robot is named."""
        return {} if self.file is None else self.file.options


@group()
class ProblemOptions(FastArmOptions):
    """Options of a fastest motion with all of its conditions."""

    poses: GoalOptions
    controller: PresetOptions
    path_constraints: PathConstraintOptions

    def conditions(self, arm: ad.Robot) -> dict[str, Any]:
        """Arguments of the problem besides the arm."""
        preset = self.controller.read()
        return super().conditions(arm) | self.path_constraints.problem_arguments(arm) | {"preset": preset}
