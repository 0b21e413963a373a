"""What controllers are given, read and checked."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.errors import ProblemError

if TYPE_CHECKING:
    from armdyn.models import Robot

Array = NDArray[np.float64]


def joint_vector(robot: "Robot", value: ArrayLike, what: str) -> Array:
    """One finite number per joint, as an array of shape (nv,).

    Raises:
        ProblemError: it is something else.
    """
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise ProblemError(f"{what} is {value!r}; expected {robot.nv} numbers, one per joint") from None
    if array.ndim == 0 and robot.nv == 1:
        array = array.reshape(1)
    if array.shape != (robot.nv,):
        raise ProblemError(
            f"{what} has shape {array.shape}; expected ({robot.nv},), one number per joint: "
            f"{', '.join(robot.joint_names)}"
        )
    for name, number in zip(robot.joint_names, array, strict=True):
        if not np.isfinite(number):
            raise ProblemError(f"{what} of joint {name!r} is {number}; it must be finite")
    return array


def one_of(what: str, value: str, known: tuple[str, ...]) -> None:
    """Raises ProblemError unless `value` is one of `known`."""
    if value not in known:
        raise ProblemError(f"{what} is {value!r}; it is one of {', '.join(map(repr, known))}")


def positive(what: str, number: float, unit: str) -> float:
    """A number that is positive and finite.

    Raises:
        ProblemError: it is not.
    """
    if not (np.isfinite(number) and number > 0):
        raise ProblemError(f"{what} is {number} {unit}; it must be positive and finite")
    return float(number)
