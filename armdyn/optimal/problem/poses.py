"""Joint positions of goals and via points: endless joints either way round, and poses within via regions."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array, Flags
from armdyn.errors import ProblemError, SpecError, reraised
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import GoalPose, deviations_of, frame_placement, poses_reaching, slid
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.problem.checks import ROUNDING

MOST_GOALS = 16
"""Largest number of goals that are tried: four joints, each either way round."""


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
        near = np.where(np.abs(near) < ROUNDING, 0.0, near)
        other = near - np.where(near > 0, 2 * np.pi, -2 * np.pi)
        either = [(a, b) if turns else (a,) for a, b, turns in zip(near, other, turning, strict=True)]
        travels += [np.array(travel) for travel in product(*either)]
    travels.sort(key=lambda travel: (float(np.max(np.abs(travel) / limits.velocity)), float(np.max(np.abs(travel)))))
    return [q_start + travel for travel in travels[:MOST_GOALS]]


Via = Array | GoalPose

_ARM = 0.3
"""Length [m] that weighs rotations of a frame against translations: about a hand's distance from the wrist."""


def via_positions(
    robot: Robot, limits: JointLimits, ends: tuple[Array, Array], via: Sequence[Any], is_clear: Callable[[Array], bool]
) -> tuple[Array, ...]:
    """Joint positions at every via point; in a region those with the least travel between the neighbouring poses.

    Args:
        robot: the arm.
        limits: limits with the positions.
        ends: start and goal [rad or m], each of shape (nv,).
        via: joint positions and regions.
        is_clear: whether joint positions are free of collisions.

    Raises:
        ProblemError: a region is out of reach.
    """
    found, given = list[Array](), [None if isinstance(one, GoalPose) else one for one in via]
    for i, one in enumerate(via):
        if not isinstance(one, GoalPose):
            found.append(one)
            continue
        after = next((q for q in given[i + 1 :] if q is not None), ends[1])
        with reraised(ProblemError, f"via[{i}]", ProblemError, SpecError):
            found.append(_sampled(robot, limits, one, (found[-1] if found else ends[0], after), is_clear))
    return tuple(found)


def _sampled(
    robot: Robot, limits: JointLimits, region: GoalPose, ends: tuple[Array, Array], is_clear: Callable[[Array], bool]
) -> Array:
    """Joint positions in a region: at its centre if that can be reached; collision-free ones if any are found.

    Of those near start, goal and the middle of both the ones with the least travel: an arm that stretches on its way
    may pass the region with its elbow on either side.
    """
    speed = np.where(np.isfinite(limits.velocity), limits.velocity, 1.0)

    def travel(q: Array) -> float:
        return float(sum(np.max(np.abs(q - end) / speed) for end in ends))

    def away(q: Array) -> float:
        off = region.pose.actInv(frame_placement(robot, region.frame, q))
        return float(np.linalg.norm(off.translation) + _ARM * np.linalg.norm(pin.log3(off.rotation)))

    def candidates() -> Iterator[Array]:
        near, nothing, middle = sorted(ends, key=away), np.zeros(robot.nv), np.add(*ends) / 2
        centre = replace(region, tolerance=())
        for goal in (centre, region):
            near_by = (slid(robot, goal, start, nothing, limits) for start in (*near, middle))
            yield from sorted((q for q in near_by if q is not None), key=travel)
        with suppress(ProblemError):
            yield from poses_reaching(robot, centre, near[0], limits)
        yield from poses_reaching(robot, region, near[0], limits)

    first: Array | None = None
    with suppress(ProblemError):
        for q in candidates():
            if is_clear(q):
                return q
            first = q if first is None else first
    return poses_reaching(robot, region, ends[0], limits)[0] if first is None else first


def check_via_regions(robot: Robot, via: Sequence[Any], poses: Array) -> None:
    """Refuse a region that contains the pose before or after it: the motion would pass the region without moving.

    Args:
        robot: the arm.
        via: joint positions and regions.
        poses: start, via points and goal [rad or m], shape (vias + 2, nv).
    """
    for i, region in enumerate(via):
        if not isinstance(region, GoalPose):
            continue
        for k in (i, i + 2):
            if np.all(np.abs(deviations_of(robot, region, poses[k])) <= region.deviations):
                name = "the start" if k == 0 else "the goal" if k == len(poses) - 1 else f"via[{k - 1}]"
                raise ProblemError(
                    f"via[{i}] is wider than its leg: {name} lies in it, so that it would be passed without moving; "
                    "give it smaller tolerances or fewer free directions, or leave it out"
                )
