"""A reference as a controller reads it: one row per tick."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.brief import brief
from armdyn.dynamics import inverse_dynamics
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_MOST = 2_000_000
"""Ticks of a reference, beyond which a rate or a duration is a mistake."""


@brief
@dataclass(frozen=True, eq=False)
class Ticks:
    """A motion, and rest at its end, at the ticks of a loop; the last row holds for good.

    Attributes:
        rate: ticks per second [Hz].
        duration: of the motion [s].
        q: positions at each tick [rad or m], shape (n, nv); likewise the others.
        v: velocities [rad/s or m/s].
        a: mean acceleration over the tick that begins there [rad/s² or m/s²].
        tau: mean torque over the tick that begins there [N m or N]; after the motion what holds the arm still.
    """

    rate: float
    duration: float
    q: Array
    v: Array
    a: Array
    tau: Array

    @classmethod
    def of(cls, robot: Robot, reference: Trajectory, rate: float) -> Self:
        """A motion's, for a robot that is to make it.

        Raises:
            ProblemError: it has another number of joints, or more ticks than two million.
        """
        if reference.v.shape[1] != robot.nv:
            raise ProblemError(
                f"the reference has {reference.v.shape[1]} joints; {robot.name} has {robot.nv}: "
                f"{', '.join(robot.joint_names)}"
            )
        duration = reference.duration
        count = int(np.ceil(duration * rate - 1e-9)) + 2
        if count > _MOST:
            raise ProblemError(f"{duration:g} s at {rate:g} Hz are {count} ticks; expected at most {_MOST}")
        t = np.arange(count) / rate
        state = reference(reference.t[0] + t)
        v = np.where(t[:, None] <= duration, state.v, 0.0)
        rest = np.zeros(robot.nv)
        holding = inverse_dynamics(robot)(reference.q[-1], rest, rest)
        a = np.diff(state.v, axis=0, append=state.v[-1:]) * rate  # a motion that ends moving is not braked in one tick
        return cls(rate, duration, state.q, v, a, _means(reference, t, holding) * rate)

    @property
    def goal(self) -> Array:
        """Where it ends [rad or m], shape (nv,)."""
        return np.asarray(self.q[-1])

    def ahead(self, ticks: int) -> Array:
        """Mean torques that many ticks later [N m or N], shape (n, nv)."""
        return np.asarray(self.tau[np.minimum(np.arange(len(self.tau)) + ticks, len(self.tau) - 1)])


def _means(reference: Trajectory, t: Array, holding: Array) -> Array:
    """Integral of the torque over each tick [N m s], shape (n, nv): exact for torques linear between samples."""
    own = reference.t - reference.t[0]
    pieces = np.diff(own)[:, None] * (reference.tau[1:] + reference.tau[:-1]) / 2
    impulse = np.vstack([np.zeros(pieces.shape[1]), np.cumsum(pieces, axis=0)])
    edges = np.append(t, 2 * t[-1] - t[-2])
    inside = np.clip(edges, 0.0, own[-1])
    k = np.clip(np.searchsorted(own, inside, side="right") - 1, 0, own.size - 2)
    s = (inside - own[k])[:, None]
    slope = (reference.tau[k + 1] - reference.tau[k]) / (own[k + 1] - own[k])[:, None]
    total = impulse[k] + s * (reference.tau[k] + s * slope / 2) + np.maximum(edges - own[-1], 0.0)[:, None] * holding
    return np.asarray(np.diff(total, axis=0))
