"""Limits of joints."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import numbers, several, shown, text
from armdyn.errors import ArmdynError, SpecError, did_you_mean
from armdyn.reprs import brief

Array = NDArray[np.float64]


@brief
@dataclass(frozen=True, kw_only=True)
class JointLimits:
    """Limits of every joint, each of shape (nv,); infinite where there is none.

    Attributes:
        position_lower: [rad or m].
        position_upper: [rad or m].
        velocity: largest speed [rad/s or m/s].
        effort_lower: [N m or N].
        effort_upper: [N m or N]; both are zero of a joint without a motor.

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

    @property
    def passive(self) -> NDArray[np.bool_]:
        """Joints without a motor, shape (nv,)."""
        return np.asarray((self.effort_lower == 0) & (self.effort_upper == 0))

    @property
    def effort_size(self) -> Array:
        """What torques are compared with [N m or N], shape (nv,): half their ranges; without a motor the others' least.

        1 where no joint has a motor.
        """
        half, motors = (self.effort_upper - self.effort_lower) / 2, ~self.passive
        return np.where(motors, half, np.min(half[motors]) if np.any(motors) else 1.0)

    def without_motors(self, passive: Iterable[str], joints: Sequence[str], error: type[ArmdynError]) -> Self:
        """The same, but for joints that have no motor.

        Args:
            passive: their names.
            joints: the names of all, in the order of the limits.
            error: what is raised.

        Raises:
            ArmdynError: as `error`; there is no such joint.
        """
        names = [
            text(name, f"passive[{i}]", error=error) for i, name in enumerate(several(passive, "passive", error=error))
        ]
        for name in names:
            if name not in joints:
                meant = did_you_mean(name, joints)
                raise error(f"passive: there is no joint {shown(name)}{meant}; there are {', '.join(joints)}")
        if not names:
            return self
        motors = np.array([name not in names for name in joints])
        return replace(
            self,
            effort_lower=np.where(motors, self.effort_lower, 0.0),
            effort_upper=np.where(motors, self.effort_upper, 0.0),
        )
