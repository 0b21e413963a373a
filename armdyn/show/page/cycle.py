"""A cycle on a page: its steps, the costs of its conditions, and the placements of the carried parts."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from armdyn.errors import ArmdynError
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.obstacles import payload_from
from armdyn.models.values.spec import Payload
from armdyn.show.markup import element, join
from armdyn.show.page.facts import Facts
from armdyn.show.page.sections import Section, stacked, th
from armdyn.show.visuals import VisualShape, body_shapes
from armdyn.trajectory import Trajectory


def step_data(motion: Trajectory) -> list[dict[str, Any]]:
    """Pieces of a motion for the scripts; empty: it is one piece."""
    if len(motion.pieces) < 2:
        return []
    start, ends = motion.t[0], [*(one.start for one in motion.pieces[1:]), motion.t[-1]]
    return [
        {
            "name": one.name,
            "begin": float(one.start - start),
            "end": float(end - start),
            "rest": bool(np.all(motion.q[(motion.t >= one.start) & (motion.t < end)] == motion(one.start).q)),
            "carries": one.load.mass if one.load else 0.0,
        }
        for one, end in zip(motion.pieces, ends, strict=True)
    ]


def steps_section(facts: Facts) -> Section | None:
    """Table of the steps: time, share, deciding limit, remedy; None: the result is no cycle."""
    steps = facts.parts("steps")
    if not steps:
        return None
    heads = ("step", "time [s]", "<share of the cycle", "<carries", "<decided by", "<what would help")
    body = [stacked(heads, [_row(one) for one in steps])]
    order = [int(x) for x in facts.numbers("order") if x is not None]
    if order != sorted(order):
        body.append(element("p", f"The order {', '.join(map(str, order))} is the fastest one.", class_="note"))
    return Section("steps", "Steps", join(body), wide=True)


def _row(step: Facts) -> list[str]:
    share, part, number = step.number("share") or 0.0, step.part("carries"), step.number("number") or 0.0
    bar = element("span", element("i", style=f"width:{min(100.0, 100 * share):.2f}%"), class_="share")
    carried = f"{part.text('name')}, {part.number('mass') or 0.0:g} kg" if part.text("name") else "–"
    return [
        th(f"{number:.0f}  {step.text('name')}", "row", data_begin=f"{step.number('begin') or 0.0:.9f}"),
        f"{step.number('duration') or 0.0:.3f}",
        element("td", bar, element("span", f"{100 * share:.0f} %"), class_="words part"),
        *(words or "–" for words in (carried, step.text("decided_by"), step.text("would_help"))),
    ]


def costs_section(facts: Facts) -> Section | None:
    """Section of the time that each condition of a cycle costs; None: not computed."""
    costs = [one.text("said") for one in facts.parts("costs")]
    if not costs:
        return None
    return Section("costs", "Cost of each condition", element("ul", *(element("li", line) for line in costs[:30])))


_MOST_PARTS = 100
_SAME_PLACE = 5e-3
"""Largest distance [m] between release and grasp of the same part."""


@dataclass(frozen=True, eq=False)
class CarriedPart:
    """A payload of a cycle, from its grasp to its release.

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
    """A placement of a part during an interval: on a joint, or standing in the world.

    Attributes:
        shapes: of the part.
        begin: when it comes there [s].
        end: when it leaves [s]; None: never.
    """

    shapes: tuple[VisualShape, ...]
    begin: float
    end: float | None


def parts_in(facts: Facts) -> list[CarriedPart]:
    """The parts of a result, which may be untrusted; malformed parts are left out."""
    found = []
    for one in facts.parts("parts")[:_MOST_PARTS]:
        begin = one.number("begin")
        with suppress(ArmdynError, TypeError, ValueError):
            entry = one.part("part").given()
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
            if before is not None and _at_same_place(before.shapes, at):
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


def _at_same_place(some: Sequence[VisualShape], others: Sequence[VisualShape]) -> bool:
    away = [one.placement[:3, 3] - other.placement[:3, 3] for one, other in zip(some, others, strict=False)]
    return len(some) == len(others) and all(np.linalg.norm(each) <= _SAME_PLACE for each in away)
