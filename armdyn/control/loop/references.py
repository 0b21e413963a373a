"""References that need no solver: rest at a pose, and a smooth ramp from one to another."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import ArrayLike

from armdyn.arguments import number
from armdyn.arrays import Array
from armdyn.dynamics import inverse_dynamics
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.trajectory import Trajectory

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
    T = number(duration, "duration", unit="s", sign="positive")
    if not _SHORTEST <= T <= _LONGEST:
        raise ProblemError(f"duration is {T:g} s; expected {_SHORTEST:g} to {_LONGEST:g} s")
    s = np.linspace(0.0, 1.0, max(_LEAST, int(np.ceil(T * _PER_SECOND)) + 1))[:, None]
    q, v, a = (
        part * (goal - start) + offset
        for part, offset in (
            (_QUINTIC(s), start),
            (_QUINTIC.deriv()(s) / T, 0.0),
            (_QUINTIC.deriv(2)(s) / T**2, 0.0),
        )
    )
    return _motion(robot, T * s[:, 0], q, v, a, "ramp")


def set_point(robot: Robot, q_goal: ArrayLike, duration: float = _INSTANT) -> Trajectory:
    """A reference that rests at a pose: `track` goes there at once from its `q_start`.

    Args:
        robot: that is held there.
        q_goal: [rad or m], shape (nv,), or the name of one of `robot.poses`.
        duration: until `Run.error_at_end` is read [s]; the pose is held for good.

    Raises:
        ProblemError: wrong length or not finite; duration not positive.
    """
    q = np.array([pose_given(expect_robot(robot), q_goal, "q_goal")] * 2)
    return _motion(
        robot,
        np.array([0.0, number(duration, "duration", unit="s", sign="positive")]),
        q,
        np.zeros_like(q),
        np.zeros_like(q),
        "set point",
    )


def _motion(robot: Robot, t: Array, q: Array, v: Array, a: Array, name: str) -> Trajectory:
    tau = inverse_dynamics(robot)(q, v, a)
    return Trajectory(t, q, v, tau, joint_names=robot.joint_names, name=robot.marked(name), model_hash=robot.model_hash)
