"""Brings the replay of a mesh's torques onto the goal, by changing them as little as that takes.

A mesh's torques are constant between knots. Where the motion ends depends on them through the variational
equations δẋ = ∂f/∂x δx + ∂f/∂τ δτ along the replay (Bryson and Ho, Applied Optimal Control, section 2.4): the smallest
change within the torque limits that cancels the miss, and Newton's method by repeating it.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import forward_dynamics_derivatives
from armdyn.models.robots.robot import Robot
from armdyn.optimal.landing.limit_violations import BETWEEN, miss_of
from armdyn.optimal.landing.rollout import replay_of
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

_ROUNDS, _CLOSED = 20, 1e-12
"""Of Newton's method for the smallest change: most take four. Where it does not close to rounding there is none."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Torques that are constant piece by piece.

    Attributes:
        t: the pieces' ends [s], shape (P + 1,).
        tau: [N m or N], shape (P, nv).
    """

    t: Array
    tau: Array

    @classmethod
    def of(cls, motion: Trajectory) -> Self | None:
        """The pieces of a motion; None if its torques are not constant between jumps."""
        t, tau, passes = motion.t, motion.tau, ~motion.jumps
        if not np.array_equal(tau[1:][passes], tau[:-1][passes]):
            return None
        first = np.append(True, np.any(tau[1:] != tau[:-1], axis=1))[:-1] & passes
        first[0] = True
        starts = np.flatnonzero(first)
        return cls(np.append(t[starts], t[-1]), tau[starts])

    def trajectory(self, like: Trajectory, samples: int) -> Trajectory:
        """The pieces as samples, with the states of the motion near them.

        Args:
            like: that motion; its times are scaled.
            samples: of every piece, besides its end.
        """
        times, torques = [], []
        for k, tau in enumerate(self.tau):
            last = k == len(self.tau) - 1
            within = np.linspace(self.t[k], self.t[k + 1], samples + 1)
            times += [*within[:-1], within[-1] if last else np.nextafter(within[-1], 0)]
            torques += [tau] * (samples + 1)
        part = np.array(times) / self.t[-1]
        at = like(like.t[0] + part * like.duration)
        return replace(like, t=np.array(times), q=at.q, v=at.v, tau=np.array(torques))


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
