"""Piecewise linear torques that track a reference motion.

Open loop an arm is as unstable as an upside-down pendulum: what lines between samples miss of a curve's torque would
grow. They are laid so that their impulses are the curve's to the fourth order, and computed torque takes off the rest,
sample by sample, by the very integration that replays the motion.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.numeric import joint_inertia
from armdyn.optimal.landing.rollout import under_linear_torque
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_CLIPS = 2
"""Rounds in which a torque is clipped to its range in the state that it leads to: each leaves 1e-3 of the excess."""


def follow(task: Task, wanted: Trajectory) -> Trajectory:
    """Track a motion with torques within their limits, and return the motion of the arm.

    Args:
        task: its robot and its torque limits.
        wanted: samples of that motion and the torques that it takes, which are smooth between jumps.

    Returns:
        States and torques, which fit each other; it ends early where the arm was lost, with two samples at least.
    """
    problem, numbers = task.problem, task.policy.curves
    robot, limits, n = problem.robot, problem.limits, problem.robot.nv
    # Where rates of the torque are limited it is the curve's: the better lines change more steeply at their corners.
    t, jumps, tau = wanted.t, wanted.jumps, wanted.tau.copy() if problem.continuous_torque else _lines(wanted)
    tau = limits.actuators.clip(tau, wanted.q, wanted.v)
    reached, bandwidth = under_linear_torque(robot), numbers.bandwidth / wanted.duration
    inertia = joint_inertia(robot)
    x = np.empty((t.size, 2 * n))
    x[0] = np.concatenate([problem.q_start, problem.v_start])
    last = 1
    for k in range(t.size - 1):
        if jumps[k]:  # no time passes
            x[k + 1] = x[k]
        else:
            beside = 2 * bandwidth * (x[k, n:] - wanted.v[k]) + bandwidth**2 * (x[k, :n] - wanted.q[k])
            fade = min((t.size - 2 - k) / numbers.samples, 1.0) if problem.continuous_torque else 1.0
            led = (
                tau[k + 1] - fade * inertia(x[k, :n]) @ beside
            )  # torques that may not jump end with what holds the arm
            tau[k + 1] = limits.actuators.clip(led, x[k, :n], x[k, n:])
            x[k + 1] = reached(t[k : k + 2], x[k], tau[k : k + 2])
            for _ in range(0 if limits.actuators.constant else _CLIPS):
                tau[k + 1] = limits.actuators.clip(led, x[k + 1, :n], x[k + 1, n:])
                x[k + 1] = reached(t[k : k + 2], x[k], tau[k : k + 2])
        if not np.all(np.isfinite(x[k + 1])):
            x[1] = x[1] if k else x[0]
            break
        last = k + 1
    m = max(last, 1) + 1
    return replace(wanted, t=t[:m], q=x[:m, :n], v=x[:m, n:], tau=tau[:m])


def _lines(motion: Trajectory) -> Array:
    """Torques at samples whose lines have the impulses of a smooth torque: less h²/12 of its second derivative."""
    tau, flows, h = motion.tau.copy(), ~motion.jumps, np.diff(motion.t)
    inner = np.flatnonzero(flows[1:] & flows[:-1]) + 1
    before, after = h[inner - 1][:, None], h[inner][:, None]
    slopes = np.diff(motion.tau, axis=0) / h[:, None]
    bend = 2 * (slopes[inner] - slopes[inner - 1]) / (before + after)
    tau[inner] -= (before**3 + after**3) / (before + after) / 12 * bend
    return tau
