"""A reference at the ticks of a loop."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics import inverse_dynamics
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory
from armdyn.trajectory.samples import mean_torques

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
        tau: mean torque over the tick that begins there [N m or N]; after the motion the holding torque.
    """

    rate: float
    duration: float
    q: Array
    v: Array
    a: Array
    tau: Array

    @classmethod
    def of(cls, robot: Robot, reference: Trajectory, rate: float) -> Self:
        """Sample a motion at the ticks, for the robot that makes it.

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
        return cls(rate, duration, state.q, v, a, _torques(reference, rate, count, holding))

    @property
    def goal(self) -> Array:
        """Last position [rad or m], shape (nv,)."""
        return np.asarray(self.q[-1])

    def ahead(self, ticks: int) -> Array:
        """Mean torques that many ticks later [N m or N], shape (n, nv)."""
        return np.asarray(self.tau[np.minimum(np.arange(len(self.tau)) + ticks, len(self.tau) - 1)])


def _torques(reference: Trajectory, rate: float, count: int, holding: Array) -> Array:
    """Mean torque over each tick [N m or N], shape (count, nv): the motion's last tick is partly at rest."""
    moving = count - 2
    edges = np.append(np.arange(moving) / rate, reference.duration)
    part = (np.diff(edges) * rate)[:, None]
    tau = np.repeat(holding[None], count, axis=0)
    tau[:moving] = mean_torques(reference, edges) * part + (1 - part) * holding
    return tau
