"""Numbers and positions of joints, as people type them: on the command line, in problem files, in study files."""

import math
import re
from typing import Literal

from armdyn.errors import ProblemError

_WITH_UNIT = re.compile(r"(.*?[0-9.i])\s*(deg|°|rad|m)", re.DOTALL)
"""A number, which ends with a digit, a point or the i of pi, and its unit."""
_PI = re.compile(r"([+-]?)(?:(\d+(?:\.\d*)?|\.\d+)\*?)?pi(?:/(\d+(?:\.\d*)?))?", re.ASCII)


def to_number(text: str) -> float:
    """A decimal number as people write it; Python's other spellings (1_000, other scripts' digits) are refused.

    Raises:
        ValueError: it is no number. NaN and infinity are numbers here.
    """
    text = text.strip()
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return float(text)


FREE: Literal["free"] = "free"
"""Stands for the position of a gripper's joint that is not locked."""


def number(text: str, what: str) -> float:
    """A number such as -1.5, 2e-3, inf, pi/20 or -3*pi/4.

    Raises:
        ProblemError: the text is no number.
    """
    text = text.strip()
    if match := _PI.fullmatch(text):
        sign, factor, divisor = match.groups()
        if not divisor or float(divisor):
            return (-1 if sign == "-" else 1) * float(factor or 1) * math.pi / float(divisor or 1)
    try:
        return to_number(text)
    except ValueError:
        raise ProblemError(f"{what}: {text!r} is not a number") from None


def numbers(text: str, what: str) -> list[float]:
    """Comma-separated numbers."""
    return [number(part, what) for part in text.split(",")]


def one_or_more(text: str, what: str) -> float | list[float] | dict[str, float]:
    """One number for all joints, one for each, or numbers by name: 12; 1,2,3; elbow=12,wrist=3."""
    if "=" in text:
        pairs = [part.partition("=") for part in text.split(",")]
        found = {name.strip(): number(value, f"{what} {name.strip()}") for name, equals, value in pairs if equals}
        if len(found) < len(pairs):
            raise ProblemError(f"{what}: {text!r} must be JOINT=NUMBER throughout, each joint once")
        return found
    values = numbers(text, what)
    return values[0] if len(values) == 1 else values


def part(text: str, what: str) -> float:
    """A part of a whole, as a number or in percent: 0.95, 95%."""
    digits = text.strip()
    return number(digits.removesuffix("%"), what) / (100 if digits.endswith("%") else 1)


def position(text: str, what: str, slides: bool | None = False, *, degrees: bool = False) -> float:
    """A joint's position [rad or m]: 1.2, pi/2, 90deg, 90°, 1.57rad, 0.1m.

    Args:
        text: as typed.
        what: the option or key, for messages.
        slides: the joint is prismatic; None: that is not known yet.
        degrees: a number without a unit is in degrees, but for pi/2 and the like, and of joints that slide.

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
    bare = not unit and "pi" not in digits and not slides and degrees
    return math.radians(value) if unit in ("deg", "°") or bare else value


def has_unit(text: str) -> bool:
    """Whether a position has a unit, or is a fraction of pi."""
    return bool(_WITH_UNIT.fullmatch(text.strip())) or "pi" in text
