"""Torques that keep to a mesh's motion where open loop they would leave it.

Errors of a mesh grow along a motion as an upside-down pendulum's do. Feedback at the knots, linear-quadratic along
the motion (Bryson and Ho, Applied Optimal Control, section 5.2; discrete in time), keeps them small; what it did
is then a sequence of constant torques like the mesh's own. Torques on their limits cannot be corrected outward, so
that the motion may have to be a little slower.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_WORTH = 0.01
"""Position error [rad or m] that is worth a torque of half the range."""
_QUICK = 0.1
"""Part of the duration in which it is to be gone: makes velocity errors comparable."""
_AT_THE_GOAL = 100.0
"""Weight of an error at the goal against one on the way."""
_AIMING = 0.3
"""Last part of the motion in which it turns to what is aimed at."""


@dataclass(frozen=True, eq=False)
class Step:
    """How a state at the end of a constant torque follows from its start, to first order.

    Attributes:
        through: ∂x'/∂x, shape (2 nv, 2 nv).
        forced: ∂x'/∂τ, shape (2 nv, nv).
        stretched: ∂x' by the same part of the time more, shape (2 nv,).
    """

    through: Array
    forced: Array
    stretched: Array


def tracked(
    problem: MinimumTimeProblem, motion: Trajectory, ends: Array, tau: Array, steps: Sequence[Step], offset: Array
) -> Array | None:
    """Torques that, replayed, stay near a motion, and end beside it.

    Args:
        problem: its limits.
        motion: to keep to.
        ends: of the pieces [s], shape (P + 1,).
        tau: constant torques that about do, shape (P, nv).
        steps: along the motion, P of them.
        offset: of the state that is aimed at from the motion's last, shape (2 nv,).

    Returns:
        Torques, shape (P, nv), within their limits; None if the motion was lost all the same.
    """
    robot, limits, n = problem.robot, problem.limits, problem.robot.nv
    half = (limits.effort_upper - limits.effort_lower) / 2
    at = motion(ends)
    aside = np.clip((ends / ends[-1] - 1) / _AIMING + 1, 0, 1) ** 2
    states, names = np.hstack([at.q, at.v]) + aside[:, None] * offset, robot.joint_names
    gains = _gains(steps, half, float(ends[-1]))
    x, chosen = states[0], np.empty_like(tau)
    for k, duration in enumerate(np.diff(ends)):
        chosen[k] = np.clip(tau[k] - gains[k] @ (x - states[k]), limits.effort_lower, limits.effort_upper)
        q, v, torque = (np.tile(part, (2, 1)) for part in (x[:n], x[n:], chosen[k]))
        piece = replay_torques(robot, Trajectory(np.array([0.0, duration]), q, v, torque, names))
        x = np.concatenate([piece.q[-1], piece.v[-1]])
        if not np.all(np.isfinite(x)) or np.max(np.abs(x[:n] - states[k + 1, :n])) > 1.0:
            return None
    return chosen


def _gains(steps: Sequence[Step], half: Array, duration: float) -> list[Array]:
    """Feedback of the linear-quadratic regulator along the motion, in N m per state error."""
    n = half.size
    error = np.repeat([1 / _WORTH, _QUICK * duration / _WORTH], n) ** 2
    ahead, gains = _AT_THE_GOAL * np.diag(error), []
    for step in reversed(steps):
        forced = step.forced * half
        gain = np.linalg.solve(np.eye(n) + forced.T @ ahead @ forced, forced.T @ ahead @ step.through)
        gains.append(half[:, None] * gain)
        ahead = np.diag(error) + step.through.T @ ahead @ (step.through - forced @ gain)
        ahead = (ahead + ahead.T) / 2
    return gains[::-1]
