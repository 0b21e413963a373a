"""Positions of joints, as people type them: numbers, units, names of poses."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING

from armdyn.cli.options.text import number
from armdyn.errors import ProblemError

if TYPE_CHECKING:
    from armdyn.models import Robot

_DEGREES: ContextVar[bool] = ContextVar("degrees", default=False)

_WITH_UNIT = re.compile(r"(.*?[0-9.i])\s*(deg|°|rad|m)", re.DOTALL)
"""A number, which ends with a digit, a point or the i of pi, and its unit."""


@contextmanager
def reading_degrees(wanted: bool) -> Iterator[None]:
    """Within it angles without a unit are in degrees: --degrees."""
    token = _DEGREES.set(wanted)
    try:
        yield
    finally:
        _DEGREES.reset(token)


def degrees_are_on() -> bool:
    """Whether --degrees was given."""
    return _DEGREES.get()


def position(text: str, what: str, slides: bool | None = False) -> float:
    """A joint's position [rad or m]: 1.2, pi/2, 90deg, 90°, 1.57rad, 0.1m.

    With --degrees a number without a unit is in degrees, but for pi/2 and the like, and of joints that slide.

    Args:
        text: as typed.
        what: the option, for messages.
        slides: the joint is prismatic; None: that is not known yet.

    Raises:
        ProblemError: it is no number, or the unit is not the joint's.
    """
    text = text.strip()
    match = _WITH_UNIT.fullmatch(text)
    digits, unit = match.groups() if match else (text, "")
    if unit and slides is not None and slides != (unit == "m"):
        has = "slides: its position is in metres" if slides else "turns: its position is an angle"
        raise ProblemError(f"{what}: {text!r}, but the joint {has}")
    value = number(digits, what)
    bare = not unit and "pi" not in digits and not slides and _DEGREES.get()
    return math.radians(value) if unit in ("deg", "°") or bare else value


def unit_said(text: str) -> bool:
    """Whether a position says its unit, or is a part of pi."""
    return bool(_WITH_UNIT.fullmatch(text.strip())) or "pi" in text


def positions(text: str, what: str, robot: Robot) -> list[float]:
    """The positions of all joints [rad or m]: numbers with commas between, or the name of one of the robot's poses.

    Raises:
        ProblemError: it is neither.
    """
    parts = text.split(",")
    if len(parts) == 1 and not _is_number(text):
        from armdyn.models.robots.poses import pose_given

        return [float(x) for x in pose_given(robot, text.strip(), what)]
    slides = map(bool, robot.slides) if len(parts) == robot.nv else [None] * len(parts)
    return [position(part, what, joint) for part, joint in zip(parts, slides, strict=True)]


def _is_number(text: str) -> bool:
    try:
        position(text, "", None)
    except ProblemError:
        return False
    return True


def sliding_locks(texts: Sequence[str], robot: Robot) -> None:
    """Refuse what --degrees would have made of a joint that slides: JOINT=0.1 without a unit.

    Args:
        texts: of --lock.
        robot: with these joints locked, which are then no joints of its model any more.

    Raises:
        ProblemError: one is such; or the robot was not read from a URDF, so that nobody knows.
    """
    bare = [joint for joint, _, value in (text.partition("=") for text in texts) if not unit_said(value)]
    if not (bare and _DEGREES.get()):
        return
    if not robot.urdf:
        raise ProblemError(f"--lock {bare[0]}: say the unit, such as 90deg or 0.1m: {robot.source} is no URDF")
    from armdyn.models.reading.urdf_xml import parse_xml

    for joint in parse_xml(robot.urdf, robot.source).iterfind("joint"):
        if joint.get("name") in bare and joint.get("type") == "prismatic":
            raise ProblemError(f"--lock {joint.get('name')}: the joint slides, --degrees is of angles: write 0.1m")
