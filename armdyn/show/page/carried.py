"""What an arm carries on a page: where each part is before its grasp, in the hand, and after its release."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from armdyn.errors import ArmdynError
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.attached import payload_from
from armdyn.models.values.spec import Payload
from armdyn.show.page.facts import Facts
from armdyn.show.visuals import VisualShape, body_shapes
from armdyn.trajectory import Trajectory

_MOST_PARTS = 100
_SAME_PLACE = 5e-3
"""A part that is grasped so near [m] to where one of its name was released is the same one."""


@dataclass(frozen=True, eq=False)
class CarriedPart:
    """A part that is grasped and perhaps released.

    Attributes:
        payload: its shapes, and the frame that carries it.
        begin: when it is grasped [s from the motion's start].
        end: when it is released [s]; None: never.
    """

    payload: Payload
    begin: float
    end: float | None


@dataclass(frozen=True, eq=False)
class ShownPart:
    """A part where it is for a while: on a joint, or standing in the world.

    Attributes:
        shapes: of the part.
        begin: when it comes there [s].
        end: when it leaves [s]; None: never.
    """

    shapes: tuple[VisualShape, ...]
    begin: float
    end: float | None


def parts_in(facts: Facts) -> list[CarriedPart]:
    """The parts of a result, which may be untrusted: those that can be made again."""
    found = []
    for one in facts.parts("parts")[:_MOST_PARTS]:
        begin = one.number("begin")
        with suppress(ArmdynError, TypeError, ValueError):
            entry = {name: value for name, value in one.part("part").values.items() if value is not None}
            if begin is not None:
                found.append(CarriedPart(payload_from(entry), max(begin, 0.0), one.number("end")))
    return found


def shown_parts(robot: Robot, motion: Trajectory, parts: Sequence[CarriedPart]) -> Iterator[ShownPart]:
    """Parts before they are grasped, while they are carried, and where they are released.

    Args:
        robot: the arm that moves.
        motion: its motion.
        parts: in the order in which they are grasped.
    """
    resting: dict[str, ShownPart] = {}
    for one in parts:
        with suppress(ArmdynError):  # a frame that the arm does not have
            carried = tuple(body_shapes(robot, one.payload))
            at = _in_world(robot, motion, carried, one.begin)
            before = resting.pop(one.payload.name, None)
            if before is not None and _near(before.shapes, at):
                yield replace(before, end=one.begin)
            else:
                if before is not None:
                    yield before
                if one.begin > 0:
                    yield ShownPart(at, 0.0, one.begin)
            yield ShownPart(carried, one.begin, one.end)
            if one.end is not None:
                resting[one.payload.name] = ShownPart(_in_world(robot, motion, carried, one.end), one.end, None)
    yield from resting.values()


def _in_world(robot: Robot, motion: Trajectory, shapes: Sequence[VisualShape], time: float) -> tuple[VisualShape, ...]:
    """Shapes where the arm has them at a time [s from the motion's start]."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.configuration(motion(motion.t[0] + time).q))
    return tuple(
        replace(shape, joint=0, placement=data.oMi[shape.joint].homogeneous @ shape.placement) for shape in shapes
    )


def _near(some: Sequence[VisualShape], others: Sequence[VisualShape]) -> bool:
    away = [one.placement[:3, 3] - other.placement[:3, 3] for one, other in zip(some, others, strict=False)]
    return len(some) == len(others) and all(np.linalg.norm(each) <= _SAME_PLACE for each in away)
