"""Violations of limits by a replay."""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.problem.status import Violation
from armdyn.trajectory import Trajectory
from armdyn.trajectory.interpolation import cubic
from armdyn.trajectory.planned import Planned

BETWEEN = 8
"""Number of points between samples at which velocities and positions are checked."""


@dataclass(frozen=True, eq=False)
class Excess:
    """Excess of a motion over one kind of limit.

    Attributes:
        limit: name of the limit, for messages.
        t: times of the check [s], shape (m,).
        beyond: excess at these times, in the limit's unit, shape (m, nv); not positive: the limit is kept.
        units: of a joint that turns, and of one that slides.
        size: size of the limit, the scale of an excess, shape (nv,).
    """

    limit: str
    t: Array
    beyond: Array
    units: tuple[str, str]
    size: Array

    @property
    def share(self) -> float:
        """The largest excess as a part of the limit; 0 if the limit is kept."""
        return max(0.0, float(np.max(self.beyond / self.size)))

    def worst(self, robot: Robot) -> Violation:
        """Largest violation, with its joint and time."""
        k, i = np.unravel_index(np.argmax(self.beyond / self.size), self.beyond.shape)
        excess = f"{self.beyond[k, i]:.3g} {self.units[int(robot.slides[i])]}"
        share = float(self.beyond[k, i] / self.size[i])
        return Violation(self.limit, robot.joint_names[i], float(self.t[k]), share, excess)


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
    fastest = np.where(np.isinf(limits.velocity), 1.0, limits.velocity)
    beyond = np.maximum(q - limits.position_upper, limits.position_lower - q)
    bounded = np.where(np.isinf(limits.position_upper), 0, limits.position_upper - limits.position_lower)
    return (
        torque_excess(limits, motion),
        Excess("velocity limit", t, np.abs(v) - limits.velocity, ("rad/s", "m/s"), fastest),
        Excess("position limit", t, beyond, ("rad", "m"), np.maximum(bounded, 1.0)),
    )


def torque_excess(limits: JointLimits, motion: Trajectory) -> Excess:
    """Excess of a motion over its torque limits, at its samples."""
    pushed = limits.actuators.excess(motion.tau, motion.q, motion.v)
    return Excess("torque limit", motion.t, pushed, ("N m", "N"), limits.actuators.scale)


def proven(robot: Robot, motion: Trajectory, torque: Excess) -> Excess:
    """The part of a table's excess over the torque limits that its rows prove.

    A derived torque is that of a mean acceleration over the steps around a row, in the row's state. While the torques
    are within constant limits so is their mean, but for the change of the inertias and of the other torques over these
    steps: that of the state, from the row before to the row after, is taken off.

    Args:
        robot: the arm.
        motion: the table.
        torque: its excess over the torque limits, at its samples.
    """
    if "tau" not in motion.derived or not robot.has_dynamics:
        return torque
    v = None if "v" in motion.derived else motion.v
    a, torques = Planned(motion.t, motion.q, v).accelerations(), inverse_dynamics(robot)
    rows, last = np.arange(motion.t.size), motion.t.size - 1
    before, after = np.maximum(rows - 1, 0), np.minimum(rows + 1, last)
    if v is None:  # the first and the last mean are over two steps, too
        before[-1], after[0] = last - 2, 2
    apart = [np.abs(torques(motion.q[k], motion.v[k], a) - motion.tau) for k in (before, after)]
    return replace(torque, beyond=torque.beyond - np.maximum(*apart))


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


def worst_violation(robot: Robot, limits: JointLimits, motion: Trajectory, dense: int = BETWEEN) -> Violation | None:
    """The largest excess over a limit; None if all are kept. Arguments as for `excesses`."""
    worst = max(excesses(limits, motion, dense), key=lambda excess: excess.share)
    return worst.worst(robot) if worst.share > 0 else None
