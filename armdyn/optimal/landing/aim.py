"""Brings the replay of a mesh's torques onto the goal, by changing them as little as that takes.

A mesh's torques are constant between knots. Where the motion ends depends on them through the variational
equations along the replay: the smallest change within the torque limits that cancels the miss, and Newton's method
by repeating it.
"""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.optimal.landing.limit_violations import BETWEEN, miss_of
from armdyn.optimal.landing.rollout import dense, replay_of
from armdyn.optimal.landing.segments import Segments
from armdyn.optimal.landing.shooting import Shooting
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
    miss, motion = miss_of(problem, trajectory, replay), Shooting.held(trajectory)
    for _ in range(numbers.rounds):
        if motion is None or miss <= numbers.landed or miss > numbers.far or task.stop:
            break
        motion = _corrected(task, motion, replay)
        if motion is None:
            break
        tried = dense(motion.trajectory(replay.joint_names), numbers.samples * len(motion.tau))
        replayed = replay_of(task, tried)
        closer = miss_of(problem, tried, replayed)
        if closer > 0.5 * miss:
            break
        trajectory = replace(replayed, name=trajectory.name)
        replay, miss = replayed, closer
    return trajectory, replay


def _corrected(task: Task, motion: Shooting, replay: Trajectory) -> Shooting | None:
    """One step of Newton's method: the smallest change that, to first order, lands and keeps velocity limits.

    None: a segment of the replay was not integrated.
    """
    problem, numbers = task.problem, task.policy.landing
    limits, n, P = problem.limits, problem.robot.nv, len(motion.tau)
    half, segments = limits.actuators.scale, Segments.of(problem.robot, replay)
    h, a = np.diff(replay.t), forward_dynamics(problem.robot)(replay.q[1:], replay.v[1:], replay.tau_end)
    stretched = h[:, None] * np.concatenate([replay.v[1:], a], axis=1) / numbers.longer
    piece = np.clip(np.searchsorted(motion.t, replay.t[:-1], side="right") - 1, 0, P - 1)
    columns = np.zeros((P, 2 * n, P * n + 1))  # of the states at the pieces' ends, by all torques and the duration
    along = np.zeros(columns.shape[1:])
    for k, own in enumerate(piece):
        along = segments.state_transition[k] @ along
        along[:, n * own : n * (own + 1)] += segments.forced[k] * half
        along[:, -1] += stretched[k]
        columns[own] = along
    if not np.all(np.isfinite(columns)):
        return None
    # A velocity is steered at the knots, so that it keeps its limit within the pieces on either side, too.
    within = np.linspace(motion.t[:-1], motion.t[1:], BETWEEN * numbers.samples + 1)
    v = replay(np.minimum(within, replay.t[-1])).v
    room = limits.velocity * (1 - numbers.below) - np.max(np.abs(v), axis=0)
    room = np.minimum(room[:-1], room[1:])
    fast = room < numbers.near * np.where(np.isinf(limits.velocity), 0.0, limits.velocity)
    slower = np.sign(v[-1, :-1]) * np.minimum(room, 0.0)
    rows = np.concatenate([columns[:-1, n:][fast], columns[-1]])
    target = np.concatenate([slower[fast], -problem.beside_goal(replay)])
    lower = np.append(((limits.actuators.lower - motion.tau) / half).ravel(), -0.5)
    upper = np.append(((limits.actuators.upper - motion.tau) / half).ravel(), 0.5)
    change = _smallest(rows, target, (lower, upper), numbers.rank)
    tau = motion.tau + change[:-1].reshape(motion.tau.shape) * half
    tau = np.clip(tau, limits.actuators.lower, limits.actuators.upper)
    return replace(motion, t=motion.t * (1 + change[-1] / numbers.longer), tau=tau)


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
