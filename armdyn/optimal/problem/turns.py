"""Goals of joints without position limits: the same pose, reached either way round."""

from collections.abc import Sequence
from itertools import product

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits

MOST_GOALS = 16
"""Largest number of goals that are tried: four joints, each either way round."""

_STILL = 1e-9
"""Distance modulo 2π below which a joint counts as already at its goal and need not move [rad]."""


def endless(robot: Robot, limits: JointLimits) -> Flags:
    """Revolute joints without position limits, shape (nv,)."""
    axes = [np.ravel(joint.createData().S)[3:] for joint in list(robot.model.joints)[1:]]
    turns = np.array([bool(np.any(axis)) for axis in axes])
    return np.asarray(turns & np.isinf(limits.position_lower) & np.isinf(limits.position_upper))


def goals_with_turns(q_start: Array, goals: Sequence[Array], limits: JointLimits, turning: Flags) -> list[Array]:
    """The goals, with each endless joint's goal reached by the shorter and by the longer way round.

    A third way, once more around, is longer than both by a turn. The order is by the lower bound on the duration by the
    velocity limits [s], then by the longest travel of a joint. A solver may stop at `MOST_GOALS` goals, the most
    that are returned, or once the next lower bound is no better than its best duration.

    Args:
        q_start: joint positions at the start [rad or m], shape (nv,).
        goals: joint positions at the goal, likewise, each meant modulo 2π.
        limits: limits with the velocities.
        turning: the endless joints, see `endless`, shape (nv,).
    """
    travels = []
    for goal in goals:
        away = goal - q_start
        near = np.where(turning, away - 2 * np.pi * np.round(away / (2 * np.pi)), away)
        near = np.where(np.abs(near) < _STILL, 0.0, near)
        other = near - np.where(near > 0, 2 * np.pi, -2 * np.pi)
        either = [(a, b) if turns else (a,) for a, b, turns in zip(near, other, turning, strict=True)]
        travels += [np.array(travel) for travel in product(*either)]
    travels.sort(key=lambda travel: (float(np.max(np.abs(travel) / limits.velocity)), float(np.max(np.abs(travel)))))
    return [q_start + travel for travel in travels[:MOST_GOALS]]
