"""References at the ticks of a loop; those that need no solver: rest at a pose, and a smooth ramp to another."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from armdyn.arguments import number
from armdyn.arrays import Array
from armdyn.dynamics import inverse_dynamics
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot
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
            ProblemError: it has another number of joints, or joints of other names, or more ticks than two million.
        """
        own, names = reference.joint_names, ", ".join(robot.joint_names)
        if reference.v.shape[1] != robot.nv:
            raise ProblemError(f"the reference has {reference.v.shape[1]} joints; {robot.name} has {robot.nv}: {names}")
        if own and own != robot.joint_names:
            raise ProblemError(f"the reference is of joints {', '.join(own)}; {robot.name} has, in this order, {names}")
        duration = reference.duration
        count = int(np.ceil(duration * rate - 1e-9)) + 2
        if count > _MOST:
            raise ProblemError(f"{duration:g} s at {rate:g} Hz are {count} ticks; expected at most {_MOST}")
        t = np.arange(count) / rate
        state = reference(reference.t[0] + t)
        v = np.where(t[:, None] <= duration, state.v, 0.0)
        holding = robot.holding_torque(reference.q[-1])
        a = np.diff(state.v, axis=0, append=state.v[-1:]) * rate  # a motion that ends moving is not braked in one tick
        known = np.any(reference.tau)  # not of a kinematic problem
        tau = _torques(reference, rate, count, holding) if known else inverse_dynamics(robot)(state.q, v, a)
        return cls(rate, duration, state.q, v, a, tau)

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


_QUINTIC = Polynomial([0, 0, 0, 10, -15, 6])
"""From 0 to 1 with velocity and acceleration zero at both ends."""
_PER_SECOND, _LEAST = 1000, 101
"""Samples of a ramp: its cubics are then within 1e-9 of the quintic's travel."""
_SHORTEST, _LONGEST = 1e-6, 100.0
"""Of a ramp [s]."""
_INSTANT = 1e-3
"""That a set point lasts [s]: it holds for good."""


def ramp(robot: Robot, q_start: ArrayLike, q_goal: ArrayLike, duration: float) -> Trajectory:
    """Reference trajectory along a quintic polynomial, from rest to rest, with synchronised joints.

    Args:
        robot: whose torques it has, by `rnea` and the joints' friction.
        q_start: [rad or m], shape (nv,), or the name of one of `robot.poses`.
        q_goal: likewise.
        duration: [s].

    Raises:
        ProblemError: wrong length or not finite; duration not within 1 µs to 100 s.
    """
    start, goal = pose_given(expect_robot(robot), q_start, "q_start"), pose_given(robot, q_goal, "q_goal")
    T = number(duration, "duration", unit="s", sign="positive", least=_SHORTEST, most=_LONGEST)
    s = np.linspace(0.0, 1.0, max(_LEAST, int(np.ceil(T * _PER_SECOND)) + 1))[:, None]
    way, v, a = (_QUINTIC.deriv(k)(s) / T**k * (goal - start) for k in range(3))
    rest = np.zeros_like(start)
    return replace(_motion(robot, T * s[:, 0], way + start, v, a, "ramp"), ends=np.array([[start, rest], [goal, rest]]))


def set_point(robot: Robot, q_goal: ArrayLike, duration: float = _INSTANT) -> Trajectory:
    """A reference that rests at a pose: `track` goes there at once from its `q_start`, and without one holds the arm.

    Args:
        robot: that is held there.
        q_goal: [rad or m], shape (nv,), or the name of one of `robot.poses`.
        duration: until `Run.error_at_end` is read [s]; the pose is held for good.

    Raises:
        ProblemError: wrong length or not finite; duration not positive.
    """
    q = np.array([pose_given(expect_robot(robot), q_goal, "q_goal")] * 2)
    t, still = np.array([0.0, number(duration, "duration", unit="s", sign="positive")]), np.zeros_like(q)
    return _motion(robot, t, q, still, still, "set point")


def _motion(robot: Robot, t: Array, q: Array, v: Array, a: Array, name: str) -> Trajectory:
    tau = inverse_dynamics(robot)(q, v, a)
    return Trajectory(t, q, v, tau, joint_names=robot.joint_names, name=robot.marked(name), model_hash=robot.model_hash)
