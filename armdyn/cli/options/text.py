"""Numbers, as people type them."""

import math
import re

from armdyn.errors import ProblemError

_PI = re.compile(r"([+-]?)(?:(\d+(?:\.\d*)?|\.\d+)\*?)?pi(?:/(\d+(?:\.\d*)?))?")


def number(text: str, what: str) -> float:
    """A number such as -1.5, 2e-3, inf, pi/20 or -3*pi/4.

    Raises:
        ProblemError: it is none.
    """
    text = text.strip()
    if match := _PI.fullmatch(text):
        sign, factor, divisor = match.groups()
        if not divisor or float(divisor):
            return (-1 if sign == "-" else 1) * float(factor or 1) * math.pi / float(divisor or 1)
    try:
        return float(text)
    except ValueError:
        raise ProblemError(f"{what}: {text!r} is not a number") from None


def numbers(text: str, what: str) -> list[float]:
    """Comma-separated numbers."""
    return [number(part, what) for part in text.split(",")]


def one_or_more(text: str | None, what: str) -> float | list[float] | None:
    """One number for all joints, or one for each."""
    if text is None:
        return None
    values = numbers(text, what)
    return values[0] if len(values) == 1 else values
