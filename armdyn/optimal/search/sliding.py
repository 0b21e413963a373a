"""Goals slid along the joint positions that reach a pose, to where velocity limits let them be reached soonest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from armdyn.models.scene.reaching import GoalPose, free_directions, slid
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.policy.search import GoalPolicy

Array = NDArray[np.float64]


def slid_goals(problem: MinimumTimeProblem, numbers: GoalPolicy) -> list[Array]:
    """Goals at which velocity limits are locally best among those that reach the pose, soonest first.

    Each of the problem's goals is slid by linear programs within a trust region, brought back onto the pose after
    each step. Empty without a goal pose, or where it is reached at isolated joint positions alone.

    Args:
        problem: with or without a goal pose.
        numbers: of the policy.
    """
    goal = problem.goal_pose
    if goal is None or not free_directions(problem.robot, goal, problem.goals[0]).size:
        return []
    speed = np.where(np.isfinite(problem.limits.velocity), problem.limits.velocity, 1.0)
    found = [_slid(problem, goal, q, speed, numbers) for q in problem.goals]
    found.sort(key=lambda q: _time(q - problem.poses[-2], speed, numbers))
    kept: list[Array] = []
    for q in found:
        if all(np.max(np.abs(q - other)) > numbers.distinct for other in kept):
            kept.append(q)
    return kept[: numbers.slid]


def _time(away: Array, speed: Array, numbers: GoalPolicy) -> float:
    """Time of the slowest joint [s], plus a small part of all joints' times, which breaks ties."""
    return float(np.max(np.abs(away) / speed) + numbers.others * np.sum(np.abs(away) / speed))


def _slid(problem: MinimumTimeProblem, goal: GoalPose, q: Array, speed: Array, numbers: GoalPolicy) -> Array:
    """Joint positions of a goal pose, moved along the pose's self-motion to a local minimum of the travel time."""
    limits, begin, longest = problem.limits, problem.poses[-2], numbers.farthest
    for _ in range(numbers.slides):
        free, room = free_directions(problem.robot, goal, q), limits_from(limits, q)
        step = _step(free, q - begin, speed, room, longest, numbers.others)
        moved = None if step is None else slid(problem.robot, goal, q, step, limits)
        if moved is not None and _time(moved - begin, speed, numbers) < _time(q - begin, speed, numbers):
            q = moved
        else:
            longest /= 4
        if longest < numbers.shortest:
            break
    return q


def limits_from(limits: JointLimits, q: Array) -> tuple[Array, Array]:
    """How far each joint may go down and up from q [rad or m], each of shape (nv,)."""
    return limits.position_lower - q, limits.position_upper - q


def _step(
    free: Array, away: Array, speed: Array, room: tuple[Array, Array], longest: float, others: float
) -> Array | None:
    """The step along free directions, shape (nv, k), after which the slowest joint needs least; None: none is found."""
    nv, k = free.shape
    # Unknown: the step along each direction, every joint's time, the slowest one's.
    times, slowest = np.diag(speed), np.zeros((nv, 1))
    above = np.block([[free, -times, slowest], [-free, -times, slowest]])
    every = np.hstack([np.zeros((nv, k)), np.eye(nv), -np.ones((nv, 1))])
    least, most = np.maximum(room[0], -longest), np.minimum(room[1], longest)
    inside = np.hstack([np.vstack([free, -free]), np.zeros((2 * nv, nv + 1))])
    solved = linprog(
        np.concatenate([np.zeros(k), np.full(nv, others), [1.0]]),
        A_ub=np.vstack([above, every, inside]),
        b_ub=np.concatenate([-away, away, np.zeros(nv), np.maximum(most, 0.0), np.maximum(-least, 0.0)]),
        bounds=[(None, None)] * (k + nv + 1),
        method="highs",
    )
    return None if solved.status != 0 else free @ solved.x[:k]
