"""Variational equations δẋ = ∂f/∂x δx + ∂f/∂τ δτ along a motion of piecewise constant torques.

Bryson and Ho, Applied Optimal Control, section 2.4.
"""

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import forward_dynamics_derivatives
from armdyn.models.robots.robot import Robot
from armdyn.optimal.landing.pieces import Pieces
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class _LinearizedStep:
    """How a state at the end of a constant torque follows from its start, to first order.

    Attributes:
        state_transition: ∂x'/∂x, shape (2 nv, 2 nv).
        forced: ∂x'/∂τ, shape (2 nv, nv).
        stretched: ∂x' by the same part of the time more, shape (2 nv,).
    """

    state_transition: Array
    forced: Array
    stretched: Array


def sensitivity(robot: Robot, pieces: Pieces, replay: Trajectory, count: int) -> tuple[Array, Array]:
    """How a motion's states at the pieces' ends answer to its torques, and to a stretch of time.

    Args:
        robot: that moves.
        pieces: its torques.
        replay: its motion.
        count: steps of the variational equations over the whole, about.

    Returns:
        ∂x by all torques, shape (P, 2 nv, P nv), and by a stretch of time, shape (P, 2 nv).
    """
    n, P = robot.nv, len(pieces.tau)
    by_torque, by_time = np.zeros((P, 2 * n, P * n)), np.zeros((P, 2 * n))
    for k, step in enumerate(_steps(robot, pieces, replay, count)):
        if k:
            by_torque[k], by_time[k] = step.state_transition @ by_torque[k - 1], step.state_transition @ by_time[k - 1]
        by_torque[k, :, n * k : n * (k + 1)] = step.forced
        by_time[k] += step.stretched
    return by_torque, by_time


def _steps(robot: Robot, pieces: Pieces, motion: Trajectory, count: int) -> list[_LinearizedStep]:
    """From every piece's start to its end, along a motion; `count` steps over the whole, about."""
    n, duration = robot.nv, pieces.t[-1]
    derivatives = forward_dynamics_derivatives(robot)
    counts = np.maximum(np.ceil(count * np.diff(pieces.t) / duration).astype(int), 2)
    found = []
    for k, parts in enumerate(counts.tolist()):
        h = (pieces.t[k + 1] - pieces.t[k]) / parts
        middles = motion(np.minimum(pieces.t[k] + h * (np.arange(parts) + 0.5), motion.t[-1]))
        state_transition, forced, stretched = np.eye(2 * n), np.zeros((2 * n, n)), np.zeros(2 * n)
        blocks = np.zeros((parts, 3 * n, 3 * n))
        blocks[:, :n, n : 2 * n] = np.eye(n)
        a, by_q, by_v, inverse = derivatives(middles.q, middles.v, np.broadcast_to(pieces.tau[k], (parts, n)))
        blocks[:, n : 2 * n] = np.concatenate([by_q, by_v, inverse], axis=2)
        rates = np.concatenate([middles.v, a], axis=1)
        for part, rate in zip(_exponentials(h * blocks), rates, strict=True):
            own = part[: 2 * n, : 2 * n]
            state_transition, forced = own @ state_transition, own @ forced + part[: 2 * n, 2 * n :]
            stretched = own @ stretched + h * rate
        found.append(_LinearizedStep(state_transition, forced, stretched))
    return found


def _exponentials(matrices: Array) -> Array:
    """The exponential of every matrix, shape (m, k, k): four terms for a sixteenth of it, squared four times."""
    small, one = matrices / 16, np.eye(matrices.shape[-1])
    power = one + small @ (one + small / 2 @ (one + small / 3 @ (one + small / 4)))
    for _ in range(4):
        power = power @ power
    return np.asarray(power)
