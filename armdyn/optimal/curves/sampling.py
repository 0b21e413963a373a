"""How densely a curve is sampled, so that torques linear between samples follow it."""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.dynamics.numeric import forward_dynamics, inverse_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.optimal.curves.curve import CurveLeg
from armdyn.optimal.problem.policy.curves import CurvePolicy
from armdyn.optimal.verify.within_limits import FASTER, PER_SAMPLE, fastest_rate
from armdyn.trajectory import Trajectory

_CHECKS = 5
"""Places of an interval, including its ends, at which a torque's second derivatives are estimated."""


def sample_counts(robot: Robot, leg: CurveLeg, speed: Array, numbers: CurvePolicy, most: int) -> Index:
    """Samples per interval for which the replay's velocity error is a given part of the velocity limits.

    Between samples h apart, linear interpolation of a torque with the second derivative τ'' makes velocities oscillate
    by h³/125 M⁻¹τ''. Where τ'' jumps, between intervals, the shared sample fits neither side: velocities are then off
    by about h³/48 of the jump of M⁻¹τ'', and by twice that at the ends of a leg.

    Args:
        robot: the arm.
        leg: leg of a curve.
        speed: velocity limits [rad/s or m/s], shape (nv,); infinite ones are replaced by the leg's largest velocity.
        numbers: the part, and the least number of samples.
        most: largest number of samples, but for a leg's least.

    Returns:
        Number of samples, shape (intervals,).
    """
    lengths, snap = np.diff(leg.basis.breaks), forced_snap(robot, leg)
    padded = np.concatenate([-snap[:1], snap, -snap[-1:]])
    jumps = np.abs(padded[1:, 0] - padded[:-1, -1])
    worst = np.maximum(np.maximum(jumps[:-1], jumps[1:]), np.max(np.abs(snap), axis=1))
    allowed = 48 * numbers.velocity_error * np.where(np.isfinite(speed), speed, leg.fastest + np.finfo(float).tiny)
    needed = leg.duration * lengths * np.cbrt(np.max(worst / allowed, axis=1))
    needed = np.maximum(np.clip(needed, numbers.samples, most), numbers.steps * lengths)
    return np.asarray(np.ceil(needed), dtype=int)


def fine_enough(robot: Robot, motion: Trajectory, numbers: CurvePolicy) -> CurvePolicy:
    """Numbers with as many samples as feedback takes to hold an arm that falls or swings during a slow motion."""
    needed = FASTER * fastest_rate(robot, motion) * motion.duration / PER_SAMPLE
    return replace(numbers, steps=max(numbers.steps, int(np.ceil(needed))))


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
