"""Steps of a cycle: move, grasp, release, wait."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Literal

from numpy.typing import ArrayLike

from armdyn.arguments import Checked, checked, expect, number, one_of, several, text
from armdyn.models.scene.obstacles import Obstacle
from armdyn.models.scene.reaching import GoalPose
from armdyn.models.values.spec import Payload
from armdyn.optimal.problem.checks import check_path_constraints
from armdyn.optimal.problem.planning_limits import PathConstraintSpec
from armdyn.reprs import brief

Axis = Literal["x", "y", "z", "-x", "-y", "-z"]
AXES: tuple[Axis, ...] = ("x", "y", "z", "-x", "-y", "-z")
_NAME = "name of a step"


@brief
@dataclass(frozen=True)
class Straight(Checked):
    """A straight segment of the tool at the end of a move, or at its beginning.

    Attributes:
        length: of the segment [m].
        axis: of the frame, at the pose where the segment ends or begins: an approach goes along it, a retreat against
            it.
        frame: that moves on the line; None: the frame of the pose, or the robot's tip.
        deviation: largest distance of the frame from the line [m].
        angle: largest turn of the frame from its orientation at the pose [rad].
    """

    length: float = checked(number, name="length of a straight segment", unit="m", sign="positive")
    _: KW_ONLY
    axis: Axis = checked(one_of, "z", name="axis of a straight segment", known=AXES)
    frame: str | None = checked(text, None, name="frame of a straight segment")
    deviation: float = checked(number, 0.5e-3, name="deviation of a straight segment", unit="m", sign="positive")
    angle: float = checked(number, 0.0087, name="angle of a straight segment", unit="rad", sign="positive")


def _straight(value: Straight | float, name: str) -> Straight:
    return value if isinstance(value, Straight) else Straight(number(value, name, unit="m", sign="positive"))


@brief
@dataclass(frozen=True, eq=False)
class Move(Checked):
    """A motion that ends at rest, as fast as the limits allow.

    Attributes:
        to: joint positions [rad or m], shape (nv,), a pose's name, or a goal pose, of which a branch of the inverse
            kinematics is chosen.
        via: passed on the way at any velocity, in this order: like `to`; a `GoalPose` with tolerances is a blend,
            passed at any of its points.
        retreat: straight segment at the beginning, or its length [m]; None: none.
        approach: likewise at the end.
        obstacles: of this move, besides the cycle's.
        speed: largest speed of the tip [m/s]; None: no such limit.
        path_constraints: of this move, besides the cycle's.
        name: in tables and messages; empty: the step's number.
    """

    to: ArrayLike | str | GoalPose
    _: KW_ONLY
    via: Sequence[ArrayLike | str | GoalPose] = checked(several, ())
    retreat: Straight | float | None = checked(_straight, None)
    approach: Straight | float | None = checked(_straight, None)
    obstacles: Sequence[Obstacle] = checked(several, ())
    speed: float | None = checked(number, None, unit="m/s", sign="positive")
    path_constraints: Sequence[PathConstraintSpec] = ()
    name: str = checked(text, "", name=_NAME)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "path_constraints", check_path_constraints(self.path_constraints))


@dataclass(frozen=True, kw_only=True)
class _Rest(Checked):
    """A step at rest."""

    dwell: float = checked(number, 0.0, unit="s", sign="not negative")
    name: str = checked(text, "", name=_NAME)


@brief
@dataclass(frozen=True)
class Grasp(_Rest):
    """The arm, at rest, takes a part: from then on it carries the part.

    Attributes:
        part: its mass, centre, inertia and shapes, in its `frame`; None: the frame of the goal pose of the move before,
            or the robot's tip. A frame placed otherwise than that of the goal pose is refused.
        dwell: how long the arm rests [s].
        name: in tables and messages; empty: "grasp" and the part's name.
    """

    part: Payload = checked(expect, name="part of a grasp", kind=Payload, hint="such as Payload(mass=1.0)")


@brief
@dataclass(frozen=True)
class Release(_Rest):
    """The arm, at rest, lets go of the part that it carries.

    At a goal pose of a frame that is placed otherwise than the part's it is refused, see `Grasp`.

    Attributes:
        part: the released part; None: the part that the arm carries.
        dwell: how long the arm rests [s].
        name: in tables and messages; empty: "release" and the part's name.
    """

    part: Payload | None = checked(
        expect, None, name="part of a release", kind=Payload, hint="the part that was grasped"
    )


@brief
@dataclass(frozen=True)
class Wait(Checked):
    """The arm rests.

    Attributes:
        seconds: how long [s].
        name: in tables and messages; empty: "wait".
    """

    seconds: float = checked(number, name="seconds of a wait", unit="s", sign="not negative")
    _: KW_ONLY
    name: str = checked(text, "", name=_NAME)

    @property
    def dwell(self) -> float:
        """How long the arm rests [s]."""
        return self.seconds


Step = Move | Grasp | Release | Wait
