"""Path constraints as a problem sees them."""

from typing import Any, Protocol, Self, runtime_checkable

from armdyn.arrays import Array
from armdyn.models.robots.robot import Robot


@runtime_checkable
class PathConstraintSpec(Protocol):
    """A path constraint, as `MinimumTimeProblem.path_constraints` takes it.

    Attributes:
        name: for people, in the plural: "torque-rate limits".
        continuous_torque: it forbids jumps of the torque, which is then linear between knots.
        curves_alone: no mesh keeps it.
    """

    @property
    def name(self) -> str: ...

    @property
    def continuous_torque(self) -> bool: ...

    @property
    def curves_alone(self) -> bool: ...

    def option_text(self) -> str:
        """The constraint as --limit and problem files say it, such as "tip-speed=0.25@tool0".

        Raises:
            ProblemError: no text says it.
        """
        ...

    def entry(self) -> str | dict[str, Any]:
        """The constraint as problem files say it: a text, as --limit does, or a table of values."""
        ...

    def fits(self, problem: Any) -> None:
        """Check a whole problem, once its poses are known.

        Args:
            problem: a `MinimumTimeProblem`.

        Raises:
            ProblemError: the constraint cannot hold in it.
        """
        ...

    def on(self, robot: Robot, start: Array, goal: Array) -> Self:
        """The constraint for an arm, checked against it and against the motion's ends.

        Args:
            robot: the arm.
            start: its state (q, v), shape (2 nv,).
            goal: likewise.

        Raises:
            ProblemError: it does not fit them; the message names argument, joint or frame, value, and what would fit.
        """
        ...
