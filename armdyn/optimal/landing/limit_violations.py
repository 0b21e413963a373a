"""Excesses of a motion over its limits."""

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.problem.status import Violation
from armdyn.trajectory import Trajectory
from armdyn.trajectory.interpolation import cubic

BETWEEN = 8
"""Number of points between samples at which velocities and positions are checked."""


@dataclass(frozen=True, eq=False)
class Excess:
    """Excess of a motion over one kind of limit.

    Attributes:
        limit: name of the limit, for messages.
        t: times of the check [s], shape (m,).
        beyond: excess at these times, in the limit's unit, shape (m, nv); not positive: the limit is kept.
        size: size of the limit, the scale of an excess, shape (nv,).
    """

    limit: str
    t: Array
    beyond: Array
    size: Array

    @property
    def share(self) -> float:
        """The largest excess as a part of the limit; 0 if the limit is kept."""
        return max(0.0, float(np.max(self.beyond / self.size)))

    def worst(self, joint_names: tuple[str, ...]) -> Violation:
        """Largest violation, with its joint and time."""
        k, i = np.unravel_index(np.argmax(self.beyond / self.size), self.beyond.shape)
        return Violation(self.limit, joint_names[i], float(self.t[k]), float(self.beyond[k, i] / self.size[i]))


def excesses(limits: JointLimits, motion: Trajectory, dense: int = BETWEEN) -> tuple[Excess, Excess, Excess]:
    """Excesses of a motion over its torque, velocity and position limits.

    Torque is linear between samples and is checked there. The size of a torque limit is half its range, that of a
    position limit its range, or 1 rad if the range is smaller or infinite.

    Args:
        limits: limits to check.
        motion: the motion.
        dense: number of points between samples at which velocities and positions are checked; 1: only the samples.
    """
    t, q, v = _between(motion, dense)
    t, q, v = np.append(motion.t, t), np.vstack([motion.q, q]), np.vstack([motion.v, v])
    bounded = np.where(np.isinf(limits.position_upper), 0, limits.position_upper - limits.position_lower)
    return (
        Excess(
            "torque limit",
            motion.t,
            limits.actuators.excess(motion.tau, motion.q, motion.v),
            limits.actuators.scale,
        ),
        Excess(
            "velocity limit",
            t,
            np.abs(v) - limits.velocity,
            np.where(np.isinf(limits.velocity), 1.0, limits.velocity),
        ),
        Excess(
            "position limit",
            t,
            np.maximum(q - limits.position_upper, limits.position_lower - q),
            np.maximum(bounded, 1.0),
        ),
    )


def _between(motion: Trajectory, dense: int) -> tuple[Array, Array, Array]:
    """Times [s], positions and velocities between a motion's samples, shapes (m,), (m, nq), (m, nv).

    Args:
        motion: the motion.
        dense: points per interval between samples, including its first sample; a jump has no further points.
    """
    flows, parts = np.flatnonzero(~motion.jumps), np.arange(1, dense)[:, None, None] / dense
    t, h = motion.t[flows, None], np.diff(motion.t)[flows, None]
    q, v = ((x[flows], x[flows + 1]) for x in (motion.q, motion.v))
    at, speed = cubic(parts, h, q, v)
    return (t + parts * h).ravel(), at.reshape(-1, at.shape[2]), speed.reshape(-1, speed.shape[2])


def limit_violation(limits: JointLimits, motion: Trajectory, dense: int = BETWEEN) -> float:
    """Largest excess over any limit, as a part of it; 0 if all are kept. Arguments as for `excesses`."""
    return max(excess.share for excess in excesses(limits, motion, dense))


def worst_violation(
    limits: JointLimits, motion: Trajectory, joint_names: tuple[str, ...], dense: int = BETWEEN
) -> Violation | None:
    """The largest excess over a limit; None if all are kept. Arguments as for `excesses`."""
    worst = max(excesses(limits, motion, dense), key=lambda excess: excess.share)
    return worst.worst(joint_names) if worst.share > 0 else None
