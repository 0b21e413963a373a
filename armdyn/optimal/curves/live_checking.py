"""Checks of a curve at fine samples: torques, velocities, positions, accelerations."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.curves.curve import CurveLeg
from armdyn.optimal.curves.live_program import LiveProblem
from armdyn.optimal.verify.certificate import LIMIT_TOLERANCE
from armdyn.trajectory import Trajectory
from armdyn.trajectory.interpolation import cubic_accelerations


@dataclass(frozen=True, eq=False)
class SampledCurve:
    """A curve at the samples of its mesh, and its excesses over limits.

    Attributes:
        t: times [s], shape (samples,).
        q: positions [rad or m], shape (samples, nv).
        v: velocities [rad/s or m/s], likewise.
        a: accelerations [rad/s² or m/s²], likewise.
        tau: torques by inverse dynamics [N m or N], likewise.
        upper: excess over the upper torque limits around each place, as parts of half the ranges, shape (places, nv);
            negative: slack. The maximum of the parabola through three samples counts.
        lower: excess over the lower torque limits, likewise.
        other: largest excess over limits of velocity, position and acceleration, as a part of them.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    upper: Array
    lower: Array
    other: float

    @property
    def torque(self) -> float:
        """Largest excess of a torque, as a part of half its range."""
        return float(max(np.max(self.upper), np.max(self.lower)))


def check(live: LiveProblem, leg: CurveLeg) -> SampledCurve:
    """Check a curve at its samples."""
    mesh, limits, duration = live.mesh, live.problem.limits, leg.duration
    derivatives = mesh.of_samples @ leg.points
    q, v, a = derivatives[0], derivatives[1] / duration, derivatives[2] / duration**2
    tau = live.program.torque_rows.torque(q, v, a)
    above, below = mesh.torque_excess(limits.actuators, q, v, tau)
    bounded = np.where(np.isinf(limits.position_upper), 1.0, limits.position_upper - limits.position_lower)
    other = max(
        float(np.max(np.abs(v) / limits.velocity)) - 1,
        float(np.max(np.maximum(q - limits.position_upper, limits.position_lower - q) / bounded)),
        acceleration_excess(duration * mesh.samples, q, v, live.acceleration),
    )
    return SampledCurve(duration * mesh.samples, q, v, a, tau, above, below, other)


def motion_of(live: LiveProblem, sampled: SampledCurve, name: str) -> Trajectory:
    """The samples as a motion."""
    robot = live.problem.robot
    q, v, tau = sampled.q, sampled.v, sampled.tau
    return Trajectory(sampled.t, q, v, tau, robot.joint_names, robot.marked(name), robot.model_hash)


def within_limits(live: LiveProblem, sampled: SampledCurve) -> bool:
    """Whether a curve satisfies all limits and distances."""
    kept = sampled.torque <= -live.numbers.live.least_reserve and sampled.other <= LIMIT_TOLERANCE
    kept = kept and between_samples(sampled, live.problem.limits, live.inertia) <= LIMIT_TOLERANCE
    return kept and live.clear(motion_of(live, sampled, "checked"))


def acceleration_excess(t: Array, q: Array, v: Array, limits: Array) -> float:
    """Largest excess over limits of acceleration, as a part of them, of the cubics between samples.

    Args:
        t: times of the samples [s], shape (samples,).
        q: positions [rad or m], shape (samples, nv).
        v: velocities [rad/s or m/s], likewise.
        limits: limits of acceleration [rad/s² or m/s²], shape (nv,); inf: none.
    """
    if np.all(np.isinf(limits)):
        return -1.0
    return float(np.max(np.abs(cubic_accelerations(t, q, v)) / limits)) - 1


def between_samples(sampled: SampledCurve, limits: JointLimits, inertia: Callable[[Array], Array]) -> float:
    """Largest excess of a torque between samples, as a part of half its range.

    The returned motion is cubic between samples. Its accelerations are linear, so that both ends of each cubic are
    checked; torques differ from the curve's by the inertia times the difference of accelerations.

    Args:
        sampled: a curve at its samples.
        limits: torque limits.
        inertia: maps positions, shape (samples, nv), to M(q) [kg m², kg m or kg], shape (samples, nv, nv).
    """
    accelerations = np.concatenate(cubic_accelerations(sampled.t, sampled.q, sampled.v))
    q, v, a, tau, M = (
        np.concatenate([each[:-1], each[1:]])
        for each in (sampled.q, sampled.v, sampled.a, sampled.tau, inertia(sampled.q))
    )
    tau += np.einsum("kij,kj->ki", M, accelerations - a)
    beyond = limits.actuators.excess(tau, q, v) / limits.actuators.half_range
    return float(np.max(beyond))
