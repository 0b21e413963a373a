"""Limits of joints."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import numbers, shown
from armdyn.errors import SpecError

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class JointLimits:
    """Limits of every joint, each of shape (nv,); infinite where there is none.

    Attributes:
        position_lower: [rad or m].
        position_upper: [rad or m].
        velocity: largest speed [rad/s or m/s].
        effort_lower: [N m or N].
        effort_upper: [N m or N].

    Raises:
        SpecError: one is not numbers, or NaN, or they are of different shapes.
    """

    position_lower: Array
    position_upper: Array
    velocity: Array
    effort_lower: Array
    effort_upper: Array

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            array = numbers(value, f"limits: {name}", "one number per joint", error=SpecError)
            if array.ndim != 1 or array.shape != np.shape(self.position_lower) or np.any(np.isnan(array)):
                raise SpecError(
                    f"limits: {name} is {shown(value)}; expected one number per joint, as many as the others"
                )
            array.setflags(write=False)
            object.__setattr__(self, name, array)
