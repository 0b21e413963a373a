"""Goals slid along the joint positions that reach a pose, to where velocity limits let them be reached soonest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from armdyn.models.scene.reaching import GoalPose, free_directions, slid
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.problem.problem import MinimumTimeProblem

Array = NDArray[np.float64]

_STEPS = 25
_FARTHEST, _SHORTEST = 0.5, 1e-3
"""Step along the goals, of any joint [rad or m]: at first and at most, and where it ends: far below what coarse
solves tell apart."""

_OTHERS = 1e-3
"""Weight of the times of all joints against that of the slowest one: joints that have time to spare stay near."""

_DISTINCT = 0.05
"""Goals of which no joint is further off than this [rad or m] are one."""

_MOST = 4
"""Goals that are kept: the soonest."""


def slid_goals(problem: MinimumTimeProblem) -> list[Array]:
    """Goals at which velocity limits are locally best among those that reach the pose, soonest first.

    Each of the problem's goals is slid by linear programs within a trust region, brought back onto the pose after
    each step. Empty without a goal pose, or where it is reached at isolated joint positions alone.
    """
    goal = problem.goal_pose
    if goal is None or not free_directions(problem.robot, goal, problem.goals[0]).size:
        return []
    speed = np.where(np.isfinite(problem.limits.velocity), problem.limits.velocity, 1.0)
    found = [_slid(problem, goal, q, speed) for q in problem.goals]
    found.sort(key=lambda q: _time(q - problem.poses[-2], speed))
    kept: list[Array] = []
    for q in found:
        if all(np.max(np.abs(q - other)) > _DISTINCT for other in kept):
            kept.append(q)
    return kept[:_MOST]


def _time(away: Array, speed: Array) -> float:
    """What the slowest joint needs [s], and a little of what all need, which tells ties apart."""
    return float(np.max(np.abs(away) / speed) + _OTHERS * np.sum(np.abs(away) / speed))


def _slid(problem: MinimumTimeProblem, goal: GoalPose, q: Array, speed: Array) -> Array:
    """A goal, slid to where no step along the pose's joint positions brings it nearer."""
    limits, begin, longest = problem.limits, problem.poses[-2], _FARTHEST
    for _ in range(_STEPS):
        step = _step(free_directions(problem.robot, goal, q), q - begin, speed, limits_from(limits, q), longest)
        moved = None if step is None else slid(problem.robot, goal, q, step, limits)
        if moved is not None and _time(moved - begin, speed) < _time(q - begin, speed):
            q = moved
        else:
            longest /= 4
        if longest < _SHORTEST:
            break
    return q


def limits_from(limits: JointLimits, q: Array) -> tuple[Array, Array]:
    """How far each joint may go down and up from q [rad or m], each of shape (nv,)."""
    return limits.position_lower - q, limits.position_upper - q


def _step(free: Array, away: Array, speed: Array, room: tuple[Array, Array], longest: float) -> Array | None:
    """The step along free directions, shape (nv, k), after which the slowest joint needs least; None: none is found."""
    nv, k = free.shape
    # Unknown: the step along each direction, every joint's time, the slowest one's.
    times, slowest = np.diag(speed), np.zeros((nv, 1))
    above = np.block([[free, -times, slowest], [-free, -times, slowest]])
    every = np.hstack([np.zeros((nv, k)), np.eye(nv), -np.ones((nv, 1))])
    least, most = np.maximum(room[0], -longest), np.minimum(room[1], longest)
    inside = np.hstack([np.vstack([free, -free]), np.zeros((2 * nv, nv + 1))])
    solved = linprog(
        np.concatenate([np.zeros(k), np.full(nv, _OTHERS), [1.0]]),
        A_ub=np.vstack([above, every, inside]),
        b_ub=np.concatenate([-away, away, np.zeros(nv), np.maximum(most, 0.0), np.maximum(-least, 0.0)]),
        bounds=[(None, None)] * (k + nv + 1),
        method="highs",
    )
    return None if solved.status != 0 else free @ solved.x[:k]
