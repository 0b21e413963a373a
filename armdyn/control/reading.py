"""What controllers are given, checked."""

import math

from armdyn.errors import ProblemError


def one_of(what: str, value: str, known: tuple[str, ...]) -> None:
    """Raises ProblemError unless `value` is one of `known`."""
    if value not in known:
        raise ProblemError(f"{what} is {value!r}; it is one of {', '.join(map(repr, known))}")


def positive(what: str, number: float, unit: str) -> float:
    """A number that is positive and finite.

    Raises:
        ProblemError: it is not.
    """
    if not (math.isfinite(number) and number > 0):
        raise ProblemError(f"{what} is {number} {unit}; it must be positive and finite")
    return float(number)
