"""Limits of joints."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    """

    position_lower: Array
    position_upper: Array
    velocity: Array
    effort_lower: Array
    effort_upper: Array

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            array = np.array(value, dtype=float)
            array.setflags(write=False)
            object.__setattr__(self, name, array)
