"""Fastest profiles of single joints from rest to rest, within limits of velocity, acceleration and jerk.

Seven phases: the acceleration rises, stays and falls, the joint cruises, and the same is reversed (Biagiotti and
Melchiorri, Trajectory Planning for Automatic Machines and Robots, 2008, section 3.4).
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array


@dataclass(frozen=True, eq=False)
class Profiles:
    """Durations of the phases of every joint's fastest profile [s], of the ways' shape; zero at joints that stay.

    Attributes:
        rising: duration of each phase in which the acceleration changes.
        steady: duration of each phase of largest acceleration.
        cruising: duration of the phase of largest velocity.
    """

    rising: Array
    steady: Array
    cruising: Array

    @classmethod
    def of(cls, way: Array, velocity: Array, acceleration: Array, jerk: Array) -> Self:
        """Profiles of joints that move alone, with zero acceleration at both ends where the jerk is limited.

        Args:
            way: distances [rad or m], shape (…, nv), not negative.
            velocity: velocity limits [rad/s or m/s], shape (nv,); these and the others may be infinite.
            acceleration: acceleration limits [rad/s² or m/s²], shape (nv,).
            jerk: jerk limits [rad/s³ or m/s³], shape (nv,).
        """
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            rising = np.nan_to_num(acceleration / jerk, nan=np.inf)  # to the largest acceleration
            full = velocity > acceleration * rising  # the acceleration limit is reached before the velocity limit
            fast = (
                np.where(full, rising, np.sqrt(velocity / jerk)),
                np.where(full, velocity / acceleration - rising, 0.0),
            )
            cruising = way / velocity - 2 * fast[0] - fast[1]
            half = (rising + np.sqrt(rising**2 + 4 * way / acceleration)) / 2
            reached = way > 2 * acceleration * rising**2
            short = np.where(reached, rising, np.cbrt(way / jerk / 2)), np.where(reached, half - 2 * rising, 0.0)
            pairs = zip((*fast, cruising), (*short, np.zeros_like(cruising)), strict=True)
            phases = [np.where(cruising >= 0, long, brief) for long, brief in pairs]
        return cls(*(np.where(way > 0, np.nan_to_num(each, nan=0.0, posinf=0.0), 0.0) for each in phases))

    @property
    def durations(self) -> Array:
        """Durations of the whole profiles [s], shape (…, nv)."""
        return 4 * self.rising + 2 * self.steady + self.cruising

    @property
    def phases(self) -> Array:
        """Durations of the seven phases [s], shape (7, …, nv)."""
        rising, steady = self.rising, self.steady
        return np.array([rising, steady, rising, self.cruising, rising, steady, rising])
