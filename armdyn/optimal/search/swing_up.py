"""Guesses for joints without a motor: ways to and fro, in the time that gravity takes for them."""

from collections.abc import Sequence

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.problem.problem import MinimumTimeProblem

_ALIKE = 0.1
"""Cosine between what gravity does along a path and what would be needed, below which it has nothing to do with it."""


def swing_up_guesses(
    problem: MinimumTimeProblem, random: np.random.Generator, count: int, swing_up_guesses: Sequence[int], unlike: float
) -> list[list[Array]]:
    """Ways on which joints without a motor swing further and further, until the last swing brings them to the goal.

    Weak motors cannot do it in fewer swings, and guesses that go straight to the goal lead to no motion then.

    Args:
        problem: what is to be solved.
        random: what varies the ways' amplitudes, and the poses of the joints with a motor.
        count: how many ways.
        swing_up_guesses: numbers of swings, by turns.
        unlike: how far a way is from an even one: standard deviation of the logarithm of a swing, and of other poses
            [rad or m].

    Returns:
        For each the poses in between [rad or m], each of shape (nv,); empty if no such joint is to move.
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
    """The duration [s] in which gravity comes nearest to swinging joints without a motor along a path; 0: none.

    What a motor would have to give at such a joint is static + inertial / T²: least squares for 1 / T².

    Args:
        problem: its limits.
        static: torques that hold the arm along the path [N m or N], shape (samples, nv).
        inertial: torques that move it along the path in one second, likewise.
    """
    passive = problem.limits.passive
    held, moved = static[:, passive], inertial[:, passive]
    against, size = -float(np.sum(held * moved)), float(np.linalg.norm(held) * np.linalg.norm(moved))
    return float(np.linalg.norm(moved) / np.sqrt(against)) if against > _ALIKE * size else 0.0
