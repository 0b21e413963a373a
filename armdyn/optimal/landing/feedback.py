"""Torques that keep to a mesh's motion where open loop they would leave it.

Errors of a mesh grow along a motion as an upside-down pendulum's do. Feedback at the knots, linear-quadratic along
the motion (Bryson and Ho, Applied Optimal Control, section 5.2; discrete in time), keeps them small; what it did
is then a sequence of constant torques like the mesh's own. Torques on their limits cannot be corrected outward, so
that the motion may have to be a little slower.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.landing.pieces import Pieces
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.landing.variation import Step
from armdyn.optimal.task.policy.landing import LandingPolicy
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


def tracked(task: Task, motion: Trajectory, pieces: Pieces, steps: Sequence[Step], offset: Array) -> Pieces | None:
    """Torques that, replayed, stay near a motion, and end beside it.

    Args:
        task: whose torque limits hold.
        motion: to keep to.
        pieces: torques that about do.
        steps: along the motion, one for each piece.
        offset: of the state that is aimed at from the motion's last, shape (2 nv,).

    Returns:
        Torques within their limits; None if the motion was lost all the same, or there is no time.
    """
    robot, limits, n = task.problem.robot, task.problem.limits, task.problem.robot.nv
    numbers, ends, tau = task.policy.landing, pieces.t, pieces.tau
    half = (limits.effort_upper - limits.effort_lower) / 2
    at = motion(ends)
    aside = np.clip((ends / ends[-1] - 1) / numbers.aiming + 1, 0, 1) ** 2
    states, names = np.hstack([at.q, at.v]) + aside[:, None] * offset, robot.joint_names
    gains = _gains(steps, half, float(ends[-1]), numbers)
    x, chosen = states[0], np.empty_like(tau)
    for k, duration in enumerate(np.diff(ends)):
        if task.stop:
            return None
        chosen[k] = np.clip(tau[k] - gains[k] @ (x - states[k]), limits.effort_lower, limits.effort_upper)
        q, v, torque = (np.tile(part, (2, 1)) for part in (x[:n], x[n:], chosen[k]))
        piece = replay_torques(robot, Trajectory(np.array([0.0, duration]), q, v, torque, names))
        x = np.concatenate([piece.q[-1], piece.v[-1]])
        if not np.all(np.isfinite(x)) or np.max(np.abs(x[:n] - states[k + 1, :n])) > numbers.lost:
            return None
    return Pieces(ends, chosen)


def _gains(steps: Sequence[Step], half: Array, duration: float, numbers: LandingPolicy) -> list[Array]:
    """Feedback of the linear-quadratic regulator along the motion, in N m per state error."""
    n = half.size
    error = np.repeat([1 / numbers.worth, numbers.quick * duration / numbers.worth], n) ** 2
    ahead, gains = numbers.at_goal * np.diag(error), []
    for step in reversed(steps):
        forced = step.forced * half
        gain = np.linalg.solve(np.eye(n) + forced.T @ ahead @ forced, forced.T @ ahead @ step.through)
        gains.append(half[:, None] * gain)
        ahead = np.diag(error) + step.through.T @ ahead @ (step.through - forced @ gain)
        ahead = (ahead + ahead.T) / 2
    return gains[::-1]
