"""Piecewise linear torques that track a reference motion.

Open loop an arm is as unstable as an inverted pendulum: the error of linear interpolation of a curve's torque would
grow. The samples are chosen for impulses equal to the curve's to fourth order, and computed torque corrects the rest,
sample by sample, by the same integration as the replay.
"""

import time
from dataclasses import replace

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.dynamics.motion import Feedback, tracked
from armdyn.dynamics.numeric import forward_dynamics, forward_dynamics_derivatives, inverse_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.optimal.flat.curve import CurveLeg
from armdyn.optimal.landing.rollout import RTOL
from armdyn.optimal.task.policy.curves import CurvePolicy
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

_CHECKS = 5
"""Places of an interval, including its ends, at which a torque's second derivatives are estimated."""
_CLIPS = 2
"""Rounds of clipping a torque to its range at the resulting state: each leaves 1e-3 of the excess."""
_LONGER = 1.0, 0.1
"""Time for the replay after the deadline [s], and part of the time limit: minutes of unstable motion may take more."""
_REST = 33
"""Most samples of a replay that the clock has cut short: it misses the goal, and checking it takes time, too."""
_FASTER = 2.0
"""Bandwidth of the feedback over the arm's fastest rate: from 1 on it holds an arm that falls. One that swings gains
energy by feedback that is half a period late, which samples so close are not."""
_PER_SAMPLE = 0.5
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


def sample_counts(robot: Robot, leg: CurveLeg, speed: Array, numbers: CurvePolicy) -> Index:
    """Samples per interval for which the replay's velocity error is a given part of the velocity limits.

    Between samples h apart, linear interpolation of a torque with the second derivative τ'' makes velocities oscillate
    by h³/125 M⁻¹τ''. Where τ'' jumps, between intervals, the shared sample fits neither side: velocities are then off
    by about h³/48 of the jump of M⁻¹τ'', and by twice that at the ends of a leg.

    Args:
        robot: the arm.
        leg: leg of a curve.
        speed: velocity limits [rad/s or m/s], shape (nv,); infinite ones are replaced by the leg's largest velocity.
        numbers: the part, and least and largest number of samples.

    Returns:
        Number of samples, shape (intervals,).
    """
    lengths, snap = np.diff(leg.basis.breaks), forced_snap(robot, leg)
    padded = np.concatenate([-snap[:1], snap, -snap[-1:]])
    jumps = np.abs(padded[1:, 0] - padded[:-1, -1])
    worst = np.maximum(np.maximum(jumps[:-1], jumps[1:]), np.max(np.abs(snap), axis=1))
    allowed = 48 * numbers.velocity_error * np.where(np.isfinite(speed), speed, leg.fastest + np.finfo(float).tiny)
    needed = leg.duration * lengths * np.cbrt(np.max(worst / allowed, axis=1))
    needed = np.maximum(np.clip(needed, numbers.samples, numbers.most_samples), numbers.steps * lengths)
    return np.asarray(np.ceil(needed), dtype=int)


def fine_enough(robot: Robot, motion: Trajectory, numbers: CurvePolicy) -> CurvePolicy:
    """Numbers with as many samples as feedback takes to hold an arm that falls or swings during a slow motion."""
    needed = _FASTER * _fastest_rate(robot, motion) * motion.duration / _PER_SAMPLE
    return replace(numbers, steps=max(numbers.steps, int(np.ceil(needed))))


def _bandwidth(robot: Robot, target: Trajectory) -> float:
    """Bandwidth that holds an arm that falls or swings [1/s], as far as the samples allow it."""
    return float(min(_FASTER * _fastest_rate(robot, target), _PER_SAMPLE / np.max(np.diff(target.t))))


def _fastest_rate(robot: Robot, motion: Trajectory) -> float:
    """Fastest rate of falling or swinging from rest along a motion [1/s]: the root of an eigenvalue of ∂a/∂q."""
    k = np.linspace(0, motion.t.size - 1, _PLACES).astype(int)
    still = np.zeros_like(motion.v[k])
    hold = inverse_dynamics(robot)(motion.q[k], still, still)
    by_q = forward_dynamics_derivatives(robot)(motion.q[k], still, hold)[1]
    return float(np.sqrt(np.max(np.abs(np.linalg.eigvals(by_q)))))


def forced_snap(robot: Robot, leg: CurveLeg) -> Array:
    """M⁻¹τ'' of the torques of a leg, without friction [rad/s⁴ or m/s⁴].

    Args:
        robot: the arm.
        leg: leg of a curve.

    Returns:
        Values at inner places of every interval, shape (intervals, 3, nv).
    """
    lengths = np.diff(leg.basis.breaks)[:, None]
    s = leg.basis.breaks[:-1, None] + lengths * np.linspace(0, 1, _CHECKS)
    q, v, a = (x.reshape(*s.shape, -1) for x in leg.at(s.ravel()))
    tau = inverse_dynamics(robot)(q, v, a) - robot.friction.torque(v)
    step = leg.duration * lengths[..., None] / (_CHECKS - 1)
    inner, acceleration = (q[:, 1:-1], v[:, 1:-1]), forward_dynamics(robot)
    tau, second_difference = tau[:, 1:-1], np.diff(tau, 2, axis=1) / step**2
    return acceleration(*inner, tau + second_difference) - acceleration(*inner, tau)


def _lines(motion: Trajectory) -> Array:
    """Torques at samples, linear between, with the impulses of a smooth torque: less h²/12 of its second derivative."""
    tau, flows, h = motion.tau.copy(), ~motion.jumps, np.diff(motion.t)
    inner = np.flatnonzero(flows[1:] & flows[:-1]) + 1
    before, after = h[inner - 1][:, None], h[inner][:, None]
    slopes = np.diff(motion.tau, axis=0) / h[:, None]
    second_difference = 2 * (slopes[inner] - slopes[inner - 1]) / (before + after)
    tau[inner] -= (before**3 + after**3) / (before + after) / 12 * second_difference
    return tau
