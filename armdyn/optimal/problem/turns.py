"""Goals of joints that turn without end: the same pose, reached by either way round."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits

MOST_WAYS = 16
"""So many goals are tried at most: four joints, each by either way."""

_STILL = 1e-9
"""Of a joint that a whole number of turns brings to its goal, so near that it need not move [rad]."""


def endless(robot: Robot, limits: JointLimits) -> Flags:
    """Joints that turn and have no position limits, shape (nv,)."""
    axes = [np.ravel(joint.createData().S)[3:] for joint in list(robot.model.joints)[1:]]
    turns = np.array([bool(np.any(axis)) for axis in axes])
    return np.asarray(turns & np.isinf(limits.position_lower) & np.isinf(limits.position_upper))


def ways_round(q_start: Array, goals: Sequence[Array], limits: JointLimits, turning: Flags) -> list[Array]:
    """The goals with every endless joint's goal by the shorter and by the longer way round.

    A third way, once more around, is longer than both by a turn. The order is by the time [s] that the
    velocity limits allow no motion to beat, and then by the longest way of a joint: a solver may stop at
    `MOST_WAYS`, where this leaves off, or as soon as that time is no better than what it has.

    Args:
        q_start: [rad or m], shape (nv,).
        goals: likewise, each a pose to be reached in any of its turns.
        limits: their velocities.
        turning: which joints are endless, see `endless`, shape (nv,).
    """
    ways = []
    for goal in goals:
        away = goal - q_start
        near = np.where(turning, away - 2 * np.pi * np.round(away / (2 * np.pi)), away)
        near = np.where(np.abs(near) < _STILL, 0.0, near)
        other = near - np.where(near > 0, 2 * np.pi, -2 * np.pi)
        either = [(a, b) if turns else (a,) for a, b, turns in zip(near, other, turning, strict=True)]
        ways += [np.array(way) for way in product(*either)]
    ways.sort(key=lambda way: (float(np.max(np.abs(way) / limits.velocity)), float(np.max(np.abs(way)))))
    return [q_start + way for way in ways[:MOST_WAYS]]
