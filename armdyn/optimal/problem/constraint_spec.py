"""Path constraints as a problem sees them: the base of `PathConstraint`."""

from typing import Any, ClassVar, Self

from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot


class PathConstraintSpec:
    """A path constraint, as `MinimumTimeProblem.path_constraints` takes it: derive from `PathConstraint`.

    Attributes:
        name: for people, in the plural: "torque-rate limits".
        continuous_torque: it forbids jumps of the torque, which is then linear between knots.
        curves_alone: no mesh keeps it.
    """

    name: ClassVar[str]
    continuous_torque: ClassVar[bool] = False
    curves_alone: ClassVar[bool] = False

    def option_text(self) -> str:
        """The constraint as --limit and problem files say it, such as "tip-speed=0.25@tool0".

        Raises:
            ProblemError: no text says it.
        """
        raise ProblemError(f"{self!r} has no text that --limit or a problem file could say it by: give option_text")

    def entry(self) -> str | dict[str, Any]:
        """The constraint as problem files say it: a text, as --limit does, or a table of values."""
        return self.option_text()

    def fits(self, problem: Any) -> None:
        """Check a whole problem, once its poses are known.

        Args:
            problem: a `MinimumTimeProblem`.

        Raises:
            ProblemError: the constraint cannot hold in it.
        """

    def on(self, robot: Robot, start: Array, goal: Array) -> Self:
        """The constraint for an arm, checked against it and against the motion's ends.

        Args:
            robot: the arm.
            start: its state (q, v), shape (2 nv,).
            goal: likewise.

        Raises:
            ProblemError: it does not fit them; the message names argument, joint or frame, value, and what would fit.
        """
        return self
