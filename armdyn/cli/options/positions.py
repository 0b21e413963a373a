"""Positions of joints, as people type them: numbers, units, names of poses."""

from __future__ import annotations

from collections.abc import Sequence

import armdyn as ad
from armdyn.cli.invocation import option_value
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import position as typed_position
from armdyn.parsing.numbers import unit_said


def degrees_are_on() -> bool:
    """Whether angles without a unit are in degrees: --degrees."""
    return bool(option_value("degrees"))


def position(text: str, what: str, slides: bool | None = False) -> float:
    """A joint's position [rad or m], as `armdyn.parsing.numbers.position` reads it; with --degrees in degrees."""
    return typed_position(text, what, slides, degrees=degrees_are_on())


def positions(text: str, what: str, robot: ad.Robot) -> list[float]:
    """The positions of all joints [rad or m]: numbers with commas between, or the name of one of the robot's poses.

    Raises:
        ProblemError: it is neither.
    """
    from armdyn.models.robots.poses import positions_of

    return positions_of(robot, text, what, degrees=degrees_are_on())


def sliding_locks(texts: Sequence[str], robot: ad.Robot) -> None:
    """Refuse --degrees for a sliding joint that is locked without a unit: JOINT=0.1.

    Args:
        texts: of --lock.
        robot: with these joints locked, which are then no joints of its model any more.

    Raises:
        ProblemError: there is such a joint; or the robot is not from a URDF, so that its joints' kinds are unknown.
    """
    bare = [joint for joint, _, value in (text.partition("=") for text in texts) if not unit_said(value)]
    if not (bare and degrees_are_on()):
        return
    if not robot.urdf:
        raise ProblemError(f"--lock {bare[0]}: say the unit, such as 90deg or 0.1m: {robot.source} is no URDF")
    from armdyn.models.reading.urdf_xml import parse_xml

    for joint in parse_xml(robot.urdf, robot.source).iterfind("joint"):
        if joint.get("name") in bare and joint.get("type") == "prismatic":
            raise ProblemError(f"--lock {joint.get('name')}: the joint slides, --degrees is of angles: write 0.1m")
