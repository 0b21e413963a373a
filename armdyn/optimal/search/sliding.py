"""Goals moved along the joint positions that reach a pose, to least time at the velocity limits."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from scipy.optimize import linprog

from armdyn.arrays import Array
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import GoalPose, free_directions, slid
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.policy.search import GoalPolicy


def slid_goals(problem: MinimumTimeProblem, numbers: GoalPolicy) -> list[Array]:
    """Goals of locally least time at the velocity limits among those that reach the pose, fastest first.

    Each of the problem's goals is moved by linear programs within a trust region, and projected onto the pose after
    each step. Empty without a goal pose, or if only isolated joint positions reach it.

    Args:
        problem: with or without a goal pose.
        numbers: settings of the descent.
    """
    goal = problem.goal_pose
    if goal is None or not free_directions(problem.robot, goal, problem.goals[0]).size:
        return []
    speed = _finite(problem.limits.velocity)
    begin = problem.poses[-2]
    found = [slid_chain(problem.robot, [None, goal], [begin, q], problem.limits, numbers)[1] for q in problem.goals]
    found.sort(key=lambda q: _time([begin, q], speed, numbers))
    kept: list[Array] = []
    for q in found:
        if all(np.max(np.abs(q - other)) > numbers.distinct for other in kept):
            kept.append(q)
    return kept[: numbers.slid]


def slid_chain(
    robot: Robot, goals: Sequence[GoalPose | None], positions: Sequence[Array], limits: JointLimits, numbers: GoalPolicy
) -> list[Array]:
    """Move joint positions along the self-motions of their goal poses to a local minimum of the travel time.

    The time is the sum of the times from each position to the next at the velocity limits, each the one of its slowest
    joint.

    Args:
        robot: the arm.
        goals: goal pose of each of the positions; None: the position is fixed. Positions of the same pose object at
            both ends of the chain stay equal.
        positions: in order [rad or m], each of shape (nv,).
        limits: limits of positions and velocities.
        numbers: settings of the descent.
    """
    at, speed, longest = list(positions), _finite(limits.velocity), numbers.largest_step
    for _ in range(numbers.slides):
        step = _step(robot, goals, at, limits, longest, numbers.others)
        moved = None if step is None else _moved(robot, goals, at, step, limits)
        if moved is not None and _time(moved, speed, numbers) < _time(at, speed, numbers):
            at = moved
        else:
            longest /= 4
        if longest < numbers.least_step:
            break
    return at


def _finite(velocity: Array) -> Array:
    return np.where(np.isfinite(velocity), velocity, 1.0)


def _time(positions: Sequence[Array], speed: Array, numbers: GoalPolicy) -> float:
    """Time of the slowest joint on every leg [s], plus a small part of all joints' times to break ties."""
    away = np.abs(np.diff(positions, axis=0)) / speed
    return float(np.sum(np.max(away, axis=1)) + numbers.others * np.sum(away))


def _moved(
    robot: Robot, goals: Sequence[GoalPose | None], at: Sequence[Array], steps: Array, limits: JointLimits
) -> list[Array] | None:
    """Positions after steps, shape (positions, nv), projected onto their poses; None: a projection failed."""
    moved = list(at)
    for k, (goal, q) in enumerate(zip(goals, at, strict=True)):
        if goal is None or not np.any(steps[k]):
            continue
        if k and k == len(at) - 1 and goal is goals[0]:
            moved[k] = moved[0]
            continue
        found = slid(robot, goal, q, steps[k], limits)
        if found is None:
            return None
        moved[k] = found
    return moved


def _step(
    robot: Robot,
    goals: Sequence[GoalPose | None],
    at: Sequence[Array],
    limits: JointLimits,
    longest: float,
    others: float,
) -> Array | None:
    """Steps along free directions, shape (positions, nv), that minimise the sum of the legs' slowest times.

    None: the linear program was not solved.
    """
    nv, legs, speed = robot.nv, len(at) - 1, _finite(limits.velocity)
    same = goals[0] is not None and goals[-1] is goals[0]
    free = [
        np.zeros((nv, 0)) if goal is None else free_directions(robot, goal, q)
        for goal, q in zip(goals, at, strict=True)
    ]
    ends = np.cumsum([0, *(each.shape[1] for each in free)])
    # Unknowns: the steps along all directions, every joint's time on every leg, every leg's slowest time.
    own = [np.zeros((nv, ends[-1])) for _ in at]
    for k, each in enumerate(free):
        own[k][:, ends[k] : ends[k + 1]] = each
    if same:
        own[-1] = own[0]
    way = np.vstack([after - before for before, after in pairwise(own)])
    away = np.concatenate([after - before for before, after in pairwise(at)])
    times, slowest = np.diag(np.tile(speed, legs)), np.zeros((nv * legs, legs))
    above = np.block([[way, -times, slowest], [-way, -times, slowest]])
    every = np.hstack([np.zeros((nv * legs, ends[-1])), np.eye(nv * legs), -np.kron(np.eye(legs), np.ones((nv, 1)))])
    moving = [k for k, each in enumerate(free) if each.shape[1] and not (same and k == legs)]
    if not moving:
        return None
    bounded = np.vstack([own[k] for k in moving])
    least = np.concatenate([np.maximum(limits.position_lower - at[k], -longest) for k in moving])
    most = np.concatenate([np.minimum(limits.position_upper - at[k], longest) for k in moving])
    inside = np.hstack([np.vstack([bounded, -bounded]), np.zeros((2 * len(least), legs * (nv + 1)))])
    solved = linprog(
        np.concatenate([np.zeros(ends[-1]), np.full(nv * legs, others), np.ones(legs)]),
        A_ub=np.vstack([above, every, inside]),
        b_ub=np.concatenate([-away, away, np.zeros(nv * legs), np.maximum(most, 0.0), np.maximum(-least, 0.0)]),
        bounds=[(None, None)] * (ends[-1] + legs * (nv + 1)),
        method="highs",
    )
    return None if solved.status != 0 else np.array([each @ solved.x[: ends[-1]] for each in own])
