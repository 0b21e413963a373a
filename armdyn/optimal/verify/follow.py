"""Piecewise linear torques that track a reference motion.

Open loop an arm is as unstable as an inverted pendulum: the error of linear interpolation of a curve's torque would
grow. The samples are chosen for impulses equal to the curve's to fourth order, and computed torque corrects the rest,
sample by sample, by the same integration as the replay.
"""

import time
from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.motion import Feedback, tracked
from armdyn.dynamics.numeric import forward_dynamics_derivatives, inverse_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.rollout import RTOL
from armdyn.trajectory import Trajectory

_CLIPS = 2
"""Rounds of clipping a torque to its range at the resulting state: each leaves 1e-3 of the excess."""
_LONGER = 1.0, 0.1
"""Time for the replay after the deadline [s], and part of the time limit: minutes of unstable motion may take more."""
_REST = 33
"""Most samples of a replay that the clock has cut short: it misses the goal, and checking it takes time, too."""
FASTER = 2.0
"""Bandwidth of the feedback over the arm's fastest rate: from 1 on it holds an arm that falls. One that swings gains
energy by feedback that is half a period late, which samples so close are not."""
PER_SAMPLE = 0.5
"""Largest bandwidth times a sample's length: at 1 the sampled feedback would become unstable."""
_PLACES = 17
"""Places along a motion at which the arm's fastest rate is estimated."""
_SPARE = 30_000
"""Largest number of accelerations in halved steps between two samples: smooth torques need none."""


def follow(task: Task, target: Trajectory) -> Trajectory:
    """Track a motion with torques within their limits, and return the motion of the arm.

    Args:
        task: task with the robot and its torque limits.
        target: samples of the motion and its torques, which are smooth between jumps.

    Returns:
        Consistent states and torques; shorter if tracking failed, with at least two samples.
    """
    problem, numbers = task.problem, task.policy.curves
    limits, n, count = problem.limits.actuators, problem.robot.nv, target.t.size
    # With limited torque rates the curve's torques are used: the corrected lines are steeper at their corners.
    tau = target.tau if problem.continuous_torque else _lines(target)
    fade = np.ones(count - 1)
    if problem.continuous_torque:  # continuous torques end with the holding torque
        fade = np.minimum((count - 2 - np.arange(count - 1)) / numbers.samples, 1.0)
    bandwidth = max(numbers.bandwidth / target.duration, _bandwidth(problem.robot, target))
    feedback = Feedback(bandwidth, fade, 0 if limits.constant else _CLIPS)
    start = np.concatenate([problem.q_start, problem.v_start])
    until = task.stop.deadline + _LONGER[0] + _LONGER[1] * task.options.time_limit
    within = limits.clip(tau, target.q, target.v)
    x, tau = tracked(
        problem.robot, target, within, start, feedback, limits,
        late=lambda: time.perf_counter() > until, rtol=RTOL, spare=_SPARE,
    )  # fmt: skip
    if len(x) < count and time.perf_counter() > until:
        task.stop.cut()
        x = x[:_REST]
    x = x if len(x) > 1 else np.vstack([x, x])
    m = len(x)
    return replace(target, t=target.t[:m], q=x[:, :n], v=x[:, n:], tau=tau[:m])


def _bandwidth(robot: Robot, target: Trajectory) -> float:
    """Bandwidth that holds an arm that falls or swings [1/s], as far as the samples allow it."""
    return float(min(FASTER * fastest_rate(robot, target), PER_SAMPLE / np.max(np.diff(target.t))))


def fastest_rate(robot: Robot, motion: Trajectory) -> float:
    """Fastest rate of falling or swinging from rest along a motion [1/s]: the root of an eigenvalue of ∂a/∂q."""
    k = np.linspace(0, motion.t.size - 1, _PLACES).astype(int)
    still = np.zeros_like(motion.v[k])
    hold = inverse_dynamics(robot)(motion.q[k], still, still)
    by_q = forward_dynamics_derivatives(robot)(motion.q[k], still, hold)[1]
    return float(np.sqrt(np.max(np.abs(np.linalg.eigvals(by_q)))))


def _lines(motion: Trajectory) -> Array:
    """Torques at samples, linear between, with the impulses of a smooth torque: less h²/12 of its second derivative."""
    tau, flows, h = motion.tau.copy(), ~motion.jumps, np.diff(motion.t)
    inner = np.flatnonzero(flows[1:] & flows[:-1]) + 1
    before, after = h[inner - 1][:, None], h[inner][:, None]
    slopes = np.diff(motion.tau, axis=0) / h[:, None]
    second_difference = 2 * (slopes[inner] - slopes[inner - 1]) / (before + after)
    tau[inner] -= (before**3 + after**3) / (before + after) / 12 * second_difference
    return tau
