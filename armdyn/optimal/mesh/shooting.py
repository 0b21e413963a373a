"""Multiple shooting: correct a mesh's motion, with torques constant or linear in its intervals, to land exactly.

Every interval is integrated by Gauss collocation of order six from its own first state. Newton's method closes the gaps
to the next states by the least change of torques, states and duration, all of one weight. The equations are those of a
linear regulator: without torques and states they are block tridiagonal in the multipliers, solved by banded Cholesky
factorization.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy.linalg import LinAlgError, solveh_banded

from armdyn.arrays import Array, Flags
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.optimal.mesh.direct import Attempt
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.rollout import ACCURACY, gauss_steps, replay_of, scales_of
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Shooting:
    """Motion on a mesh with torques linear in its intervals.

    Attributes:
        t: knots [s], shape (K + 1,).
        x: states (q, v) at the knots, shape (K + 1, 2 nv).
        tau: torques at start and end of the intervals [N m or N], shape (K, 2, nv).
    """

    t: Array
    x: Array
    tau: Array

    @classmethod
    def of(cls, problem: MinimumTimeProblem, attempt: Attempt, near: float) -> Self:
        """Make the motion from a solution on a mesh, from the start to the goal.

        Args:
            problem: problem with end states and torque limits.
            attempt: a solution with torques constant or linear in its intervals.
            near: distance within which a torque is on its limit, as a part of half its range.
        """
        motion, actuators = attempt.trajectory, problem.limits.actuators
        t = attempt.mesh * motion.duration
        at, middle = motion(t), motion((t[:-1] + t[1:]) / 2).tau
        half = 2 * (middle - motion(t[:-1] + np.diff(t) / 4).tau)
        tau = np.stack([middle - half, middle + half], axis=1)
        x, level = np.concatenate([at.q, at.v], axis=1), (tau - actuators.center) / actuators.scale
        x[0] = np.concatenate([problem.q_start, problem.v_start])
        x[-1] = np.concatenate([problem.q_goal, problem.v_goal])
        tau = np.where(level > 1 - near, actuators.upper, np.where(level < near - 1, actuators.lower, tau))
        return cls(t, x, tau)

    @property
    def size(self) -> Array:
        """Scale of each state: the joint's way and its largest speed, shape (2 nv,)."""
        n = self.tau.shape[-1]
        return scales_of(np.ptp(self.x[:, :n], axis=0), np.max(np.abs(self.x[:, n:]), axis=0))

    def trajectory(self, names: tuple[str, ...]) -> Trajectory:
        """Samples at both ends of every interval; the torque jumps one ulp before a knot."""
        K, _, n = self.tau.shape
        t, x = np.empty(2 * K), np.repeat(self.x, 2, axis=0)[1:-1]
        t[0::2], t[1::2] = self.t[:-1], np.nextafter(self.t[1:], 0)
        t[-1] = self.t[-1]
        return Trajectory(t, x[:, :n], x[:, n:], self.tau.reshape(2 * K, n), names, "minimum time")


def gaps(robot: Robot, motion: Shooting, steps: int) -> tuple[Array, Array, Array, Array]:
    """Gaps between the intervals' integrated ends and the next states, and their derivatives, in units of `size`.

    Args:
        robot: the robot.
        motion: motion on a mesh.
        steps: least number of steps of the whole motion; at least one in every interval.

    Returns:
        Gaps, shape (K, 2 nv); their derivatives with respect to the interval's first state, shape (K, 2 nv, 2 nv), a
        change of its torque, shape (K, 2 nv, nv), and the scale of the motion's time, shape (K, 2 nv).
    """
    h, n, size = np.diff(motion.t), robot.nv, motion.size
    end, by_state, by_torque = gauss_steps(robot)(h, motion.x[:-1], motion.tau, max(1, -(-steps // h.size)))
    rate = np.concatenate([end[:, n:], forward_dynamics(robot)(end[:, :n], end[:, n:], motion.tau[:, 1])], axis=1)
    return (
        (end - motion.x[1:]) / size,
        by_state * size / size[:, None],
        by_torque / size[:, None],
        rate * h[:, None] / size,
    )


def landed(task: Task, attempt: Attempt) -> Shooting | None:
    """Correct a mesh's motion to reach the goal within the torque limits; None if no such motion is near.

    Args:
        task: the problem and its settings.
        attempt: a solution with torques constant or linear in its intervals.
    """
    numbers, actuators = task.policy.shooting, task.problem.limits.actuators
    motion = Shooting.of(task.problem, attempt, numbers.near)
    free = np.all((motion.tau > actuators.lower) & (motion.tau < actuators.upper), axis=1)
    for _ in range(numbers.rounds):
        found = gaps(task.problem.robot, motion, numbers.steps)
        if task.stop or not np.all(np.isfinite(found[0])):
            return None
        if np.max(np.abs(found[0])) <= numbers.closed:
            return motion
        step = _newton_step(motion, found, free, task)
        if step is None:
            return None
        motion, free = step
    return None


def replay_on_goal(task: Task, attempt: Attempt) -> Trajectory:
    """Replay a mesh's motion, corrected to reach the goal if possible.

    The rest after multiple shooting (with dry friction the whole miss) is corrected by the replay's miss, from the
    replay's states.
    """
    problem, numbers = task.problem, task.policy.shooting
    actuators = problem.limits.actuators
    motion = landed(task, attempt) or Shooting.of(problem, attempt, numbers.near)
    free = np.all((motion.tau > actuators.lower) & (motion.tau < actuators.upper), axis=1)
    replay, miss = _replayed(task, motion)
    for _ in range(numbers.rounds):
        if miss <= 100 * ACCURACY or miss > numbers.far or task.stop:
            break
        x = np.concatenate([replay.q, replay.v], axis=1)[np.append(np.arange(0, len(replay.t), 2), -1)]
        x[-1] = problem.x_goal
        tried = replace(motion, x=x)
        found = gaps(problem.robot, tried, numbers.steps)
        if not all(np.all(np.isfinite(each)) for each in found):
            break
        found[0][:-1], found[0][-1] = 0.0, problem.goal_error_of(replay) / tried.size
        step = _newton_step(tried, found, free, task)
        if step is None:
            break
        motion, free = step
        replayed, closer = _replayed(task, motion)
        if closer > miss / 2:
            break
        replay, miss = replayed, closer
    return replay


def _replayed(task: Task, motion: Shooting) -> tuple[Trajectory, float]:
    """The replay of a motion, and its goal error [rad or m, and per second]; inf: the replay broke off."""
    replay = replay_of(task, motion.trajectory(task.problem.robot.joint_names))
    whole = replay.t[-1] == motion.t[-1]
    return replay, float(np.max(np.abs(task.problem.goal_error_of(replay)))) if whole else np.inf


def _newton_step(
    motion: Shooting, found: tuple[Array, Array, Array, Array], free: Flags, task: Task
) -> tuple[Shooting, Flags] | None:
    """One step of Newton's method, and the torques that remain free: one that would exceed a limit is fixed to it.

    Returns:
        None if too few torques are free to correct the states.
    """
    gap, by_state, by_torque, by_time = found
    actuators, (K, _, n) = task.problem.limits.actuators, motion.tau.shape
    share = np.diff(motion.t)[:, None] / motion.t[-1]
    # Torques scaled by the square roots of their weights.
    moved = by_torque * (np.where(free, actuators.scale, 0.0) / np.sqrt(share))[:, None, :]
    carried = by_state.copy()
    carried[0] = 0.0  # first and last state are fixed
    own = np.append(np.ones(K - 1), 0.0)
    diagonal = moved @ moved.swapaxes(1, 2) + carried @ carried.swapaxes(1, 2) + own[:, None, None] * np.eye(2 * n)
    above = -carried[1:].swapaxes(1, 2)  # block (k, k + 1)
    matrix = _banded(diagonal, above)
    try:
        both = solveh_banded(matrix, np.stack([gap.ravel(), by_time.ravel()], axis=1), lower=True)
    except LinAlgError:
        return None
    stretch = by_time.ravel() @ both[:, 0] / (1 + by_time.ravel() @ both[:, 1])
    multipliers = (both[:, 0] - stretch * both[:, 1]).reshape(K, 2 * n)
    weights = np.where(free, actuators.scale**2, 0.0) / share
    change = -weights * np.einsum("kan,ka->kn", by_torque, multipliers)
    states = np.einsum("kab,ka->kb", by_state[1:], multipliers[1:]) - multipliers[:-1]
    x, tau = motion.x.copy(), np.clip(motion.tau + change[:, None], actuators.lower, actuators.upper)
    x[1:-1] -= states * motion.size
    free = free & np.all((tau > actuators.lower) & (tau < actuators.upper), axis=1)
    return replace(motion, t=motion.t * (1 - stretch), x=x, tau=tau), free


def _banded(diagonal: Array, above: Array) -> Array:
    """Diagonals of a symmetric block tridiagonal matrix from the main one down, for `solveh_banded`; shape (2 m, K m).

    Args:
        diagonal: diagonal blocks, shape (K, m, m).
        above: blocks above the diagonal, shape (K - 1, m, m).
    """
    K, m, _ = diagonal.shape
    blocks = np.zeros((K, 2 * m, m))  # a column of blocks: the diagonal one and the one below
    blocks[:, :m] = diagonal
    blocks[:-1, m:] = above.swapaxes(1, 2)
    bands = np.zeros((2 * m, K, m))
    for column in range(m):
        bands[: 2 * m - column, :, column] = blocks[:, column:, column].T
    return bands.reshape(2 * m, K * m)
