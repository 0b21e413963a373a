"""Guesses for joints without a motor: swing-up paths, timed by gravity."""

from collections.abc import Sequence

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.problem.problem import MinimumTimeProblem

_ALIKE = 0.1
"""Cosine between gravity's and the required torques along a path, below which gravity does not drive the motion."""


def swing_up_guesses(
    problem: MinimumTimeProblem, random: np.random.Generator, count: int, swing_up_guesses: Sequence[int], unlike: float
) -> list[list[Array]]:
    """Paths on which joints without a motor swing further and further, until the last swing reaches the goal.

    Weak motors need that many swings, and guesses straight to the goal then lead to no motion.

    Args:
        problem: the minimum-time problem.
        random: random generator of amplitudes, and of the poses of joints with a motor.
        count: number of paths.
        swing_up_guesses: numbers of swings, used in turn.
        unlike: spread of the paths: standard deviation of the logarithm of a swing, and of other poses [rad or m].

    Returns:
        For each path the via poses [rad or m], each of shape (nv,); empty if no such joint moves.
    """
    start, away = np.asarray(problem.q_start), np.asarray(problem.q_goal) - np.asarray(problem.q_start)
    passive, limits = problem.limits.passive, problem.limits
    if not np.any(away[passive]):
        return []
    ways = []
    for k in range(count):
        most = swing_up_guesses[k % len(swing_up_guesses)]
        parts = np.arange(1, most + 1)[:, None] / (most + 1)
        sides = np.where((most - np.arange(most))[:, None] % 2, -1.0, 1.0)  # the last swing is away from the goal
        swung = parts * sides * away * random.lognormal(0, unlike, (most, away.size))
        moved = parts * away + random.normal(0, unlike, (most, away.size))
        poses = start + np.where(passive, swung, moved)
        ways.append(list(np.clip(poses, limits.position_lower, limits.position_upper)))
    return ways


def swinging_time(problem: MinimumTimeProblem, static: Array, inertial: Array) -> float:
    """Duration [s] in which gravity comes nearest to driving joints without a motor along a path; 0: none.

    The required torque of such a joint is static + inertial / T²: least squares for 1 / T².

    Args:
        problem: problem with the limits.
        static: torques that hold the arm along the path [N m or N], shape (samples, nv).
        inertial: torques that move it along the path in one second, likewise.
    """
    passive = problem.limits.passive
    held, moved = static[:, passive], inertial[:, passive]
    against, size = -float(np.sum(held * moved)), float(np.linalg.norm(held) * np.linalg.norm(moved))
    return float(np.linalg.norm(moved) / np.sqrt(against)) if against > _ALIKE * size else 0.0
