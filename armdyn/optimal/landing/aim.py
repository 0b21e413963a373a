"""Brings the replay of a mesh's torques onto the goal, by changing them as little as that takes.

A mesh's torques are constant between knots. Where the motion ends depends on them through the variational
equations along the replay: the smallest change within the torque limits that cancels the miss, and Newton's method
by repeating it.
"""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.landing.limit_violations import BETWEEN, miss_of
from armdyn.optimal.landing.pieces import Pieces
from armdyn.optimal.landing.rollout import replay_of
from armdyn.optimal.landing.variation import sensitivity
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

_ROUNDS, _CLOSED = 20, 1e-12
"""Of Newton's method for the smallest change: most take four. Where it does not close to rounding there is none."""


def aimed(task: Task, trajectory: Trajectory) -> tuple[Trajectory, Trajectory]:
    """A motion whose replay lands, and that replay; unchanged where torques are not constant or far from it.

    Args:
        task: its goal, and limits of torque and velocity.
        trajectory: a collocation solution.
    """
    problem, numbers = task.problem, task.policy.landing
    replay = replay_of(task, trajectory)
    miss, pieces = miss_of(problem, trajectory, replay), Pieces.of(trajectory)
    for _ in range(numbers.rounds):
        if pieces is None or miss <= numbers.landed or miss > numbers.far or task.stop:
            break
        pieces = _corrected(task, pieces, replay)
        tried = pieces.trajectory(replay, numbers.samples)
        replayed = replay_of(task, tried)
        closer = miss_of(problem, tried, replayed)
        if closer > 0.5 * miss:
            break
        trajectory = replace(replayed, name=trajectory.name)
        replay, miss = replayed, closer
    return trajectory, replay


def _corrected(task: Task, pieces: Pieces, replay: Trajectory) -> Pieces:
    """One step of Newton's method: the smallest change that, to first order, lands and keeps velocity limits."""
    problem, numbers = task.problem, task.policy.landing
    limits, n = problem.limits, problem.robot.nv
    half = limits.actuators.scale
    by_torque, by_time = sensitivity(problem.robot, pieces, replay, numbers.steps)
    columns = np.concatenate([by_torque * np.tile(half, len(pieces.tau)), by_time[..., None] / numbers.longer], axis=2)
    # A velocity is steered at the knots, so that it keeps its limit within the pieces on either side, too.
    within = np.linspace(pieces.t[:-1], pieces.t[1:], BETWEEN * numbers.samples + 1)
    v = replay(np.minimum(within, replay.t[-1])).v
    room = limits.velocity * (1 - numbers.below) - np.max(np.abs(v), axis=0)
    room = np.minimum(room[:-1], room[1:])
    fast = room < numbers.near * np.where(np.isinf(limits.velocity), 0.0, limits.velocity)
    slower = np.sign(v[-1, :-1]) * np.minimum(room, 0.0)
    rows = np.concatenate([columns[:-1, n:][fast], columns[-1]])
    target = np.concatenate([slower[fast], -problem.beside_goal(replay)])
    lower = np.append(((limits.actuators.lower - pieces.tau) / half).ravel(), -0.5)
    upper = np.append(((limits.actuators.upper - pieces.tau) / half).ravel(), 0.5)
    change = _smallest(rows, target, (lower, upper), numbers.rank)
    tau = pieces.tau + change[:-1].reshape(pieces.tau.shape) * half
    return Pieces(
        pieces.t * (1 + change[-1] / numbers.longer), np.clip(tau, limits.actuators.lower, limits.actuators.upper)
    )


def _smallest(rows: Array, target: Array, bounds: tuple[Array, Array], rank: float) -> Array:
    """The least-norm y of rows y = target within bounds; where there is none, some y within bounds.

    y is rowsᵀ λ, clipped at its bounds: Newton's method on λ, with equations that are made orthonormal once.
    """
    left, sizes, right = np.linalg.svd(rows, full_matrices=False)
    sure = sizes > rank * sizes[0]
    equations, values = right[sure], left[:, sure].T @ target / sizes[sure]
    multipliers, y = np.zeros(len(equations)), np.zeros_like(bounds[0])
    for _ in range(_ROUNDS):
        unclipped = multipliers @ equations
        y = np.clip(unclipped, *bounds)
        gap = values - equations @ y
        if np.max(np.abs(gap)) <= _CLOSED * np.max(np.abs(values)):
            break
        own = equations[:, y == unclipped]
        multipliers = multipliers + np.linalg.solve(own @ own.T + rank * np.eye(len(own)), gap)
    return y
