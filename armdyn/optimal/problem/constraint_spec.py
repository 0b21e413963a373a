"""Base class of path constraints in a problem: name, checks, entry in files."""

from typing import Any, ClassVar, Self

from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot


class PathConstraintSpec:
    """Element of `MinimumTimeProblem.path_constraints`; new constraints derive from `PathConstraint`.

    Attributes:
        name: plural, for messages: "torque-rate limits".
        continuous_torque: whether the torque must be continuous, hence linear between knots.
        of_torques: whether the constraint is about torques, so that a kinematic problem cannot have it.
        curves_alone: whether only curves, not meshes, can satisfy the constraint.
    """

    name: ClassVar[str]
    continuous_torque: ClassVar[bool] = False
    of_torques: ClassVar[bool] = False
    curves_alone: ClassVar[bool] = False

    def option_text(self) -> str:
        """Text of the constraint for --limit and problem files, such as "tip-speed=0.25@tool0".

        Raises:
            ProblemError: the constraint has no text.
        """
        raise ProblemError(f"{self!r} has no text for --limit or a problem file: implement option_text")

    def entry(self) -> str | dict[str, Any]:
        """Entry of the constraint in a problem file: the text of `option_text`, or a table of values."""
        return self.option_text()

    def fits(self, problem: Any) -> None:
        """Check the constraint against a whole problem, once its poses are known.

        Args:
            problem: a `MinimumTimeProblem`.

        Raises:
            ProblemError: the constraint cannot hold in the problem.
        """

    def on(self, robot: Robot, start: Array, goal: Array) -> Self:
        """Bind the constraint to an arm; check it against the arm and the motion's ends.

        Args:
            robot: the arm.
            start: its state (q, v), shape (2 nv,).
            goal: goal state (q, v), shape (2 nv,).

        Raises:
            ProblemError: the constraint does not fit; the message names argument, joint or frame, value and remedy.
        """
        return self
