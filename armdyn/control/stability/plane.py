"""Stability of a PID loop over the plane of kp and kd, continuous and sampled."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.arguments import number, numbers
from armdyn.control.laws.pid import Form, Pid, PidGains
from armdyn.control.loop.loop import Loop, expect_loop
from armdyn.control.stability.linear import Rest
from armdyn.control.stability.poles import ArmAtGoal, closed_loop_matrix, eigenvalues
from armdyn.control.stability.sampled import SampledLoop
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.reprs import brief

Array = NDArray[np.float64]


@brief
@dataclass(frozen=True, eq=False)
class GainPlane:
    """A PID loop at a goal, with one kp, ki and kd for all joints, over a grid of kp and kd.

    Attributes:
        kp: shape (n,); units as in `PidGains`, and increasing; likewise the others.
        kd: shape (m,).
        ki: of all points.
        growth: largest real part [1/s] of the continuous loop's eigenvalues, shape (m, n).
        radius: spectral radius [-] of the sampled loop, shape (m, n).
    """

    kp: Array
    kd: Array
    ki: float
    growth: Array
    radius: Array


def gain_plane(
    robot: Robot,
    q_goal: ArrayLike,
    *,
    kp: ArrayLike,
    kd: ArrayLike,
    ki: float,
    form: Form = "torque",
    loop: Loop | None = None,
) -> GainPlane:
    """Growth and spectral radius over a grid; a point takes about half a millisecond.

    Args:
        robot: an arm, which the controller knows.
        q_goal: [rad or m], shape (nv,).
        kp: shape (n,), increasing.
        kd: shape (m,), increasing.
        ki: one number.
        form: of the controller's output, see `Form`.
        loop: how it is sampled; None: `Loop()`.

    Raises:
        ProblemError: the goal does not fit the robot; gains that are negative or do not increase; a continuous loop.
    """
    goal = pose_given(expect_robot(robot), q_goal, "q_goal")
    p, d = _increasing(kp, "kp"), _increasing(kd, "kd")
    i, how = number(ki, "ki", sign="not negative"), expect_loop(loop, Loop())
    growth, radius = np.empty((d.size, p.size)), np.empty((d.size, p.size))
    one, two = (Rest.of(robot, goal, Pid(PidGains(x, i, x), form, feedforward=False), how) for x in (1.0, 2.0))
    arm = ArmAtGoal.of(robot, goal, form)
    for place in np.ndindex(growth.shape):
        kp_here, kd_here = float(p[place[1]]), float(d[place[0]])
        gains = PidGains(kp_here, i, kd_here).per_joint(robot.nv)
        growth[place] = eigenvalues(closed_loop_matrix(arm, *gains))[0].real
        radius[place] = SampledLoop.of(_between(one, two, kp_here, kd_here), how).radius
    return GainPlane(p, d, i, growth, radius)


def _between(one: Rest, two: Rest, kp: float, kd: float) -> Rest:
    """Interpolate the loop's linearisation: in every form the torque is affine in kp and kd."""
    low, high = one.law, two.law
    law = replace(low, q=low.q + (kp - 1) * (high.q - low.q), v=low.v + (kd - 1) * (high.v - low.v))
    return replace(one, law=law)


def _increasing(value: ArrayLike, name: str) -> Array:
    gains = numbers(value, name, "increasing numbers")
    if gains.ndim != 1 or gains.size < 2 or not np.all(np.diff(gains) > 0) or not 0 <= gains[0] < np.inf:
        raise ProblemError(
            f"{name} has shape {gains.shape}; expected two or more increasing gains that are not negative"
        )
    return gains
