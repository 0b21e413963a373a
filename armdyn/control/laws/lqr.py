"""A linear-quadratic regulator that varies along the reference."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import Sign
from armdyn.control.laws.linear import Steps, best_gains, loop_steps, plant_steps
from armdyn.control.laws.readings import Readings, law_function, table
from armdyn.control.laws.reference import expect_motors, reference_of
from armdyn.control.loop.law import Law
from armdyn.control.loop.loop import Loop
from armdyn.control.loop.ticks import Ticks
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.values.per_joint import per_joint

Array = NDArray[np.float64]

PerJoint = float | tuple[float, ...]
"""One number for all joints, or one per joint."""


@dataclass(frozen=True)
class Lqr:
    """tau = tau_ref + K (e, ė, ∫e dt, tau_ref - tau of what is decided and not yet felt), with K of each tick.

    K makes least Σ |e/position|² + |velocity ė/position|² + |integral ∫e dt/position|² + |u/half the torque range|²
    over the ticks, of an arm that is linear about the reference and of a loop with its delay; at the goal, for
    good. So an error of `position` is as bad as half the torque range.

    Attributes:
        position: error [rad or m] that is worth half of a joint's torque range: one number, or one per joint.
        velocity: what a velocity error counts beside a position error [s], likewise.
        integral: likewise, of the error's integral [1/s]; 0: the integral is not used.

    Raises:
        ProblemError: not positive or not finite; counts that do not agree.
    """

    position: PerJoint = 0.05
    velocity: PerJoint = 0.007
    integral: PerJoint = 2.0

    def __post_init__(self) -> None:
        counts = set()
        for name, value in vars(self).items():
            sign: Sign = "positive" if name == "position" else "not negative"
            array = per_joint(value, None, name, error=ProblemError, sign=sign)
            object.__setattr__(self, name, float(array) if array.ndim == 0 else tuple(map(float, array)))
            counts |= {array.size} if array.ndim else set()
        if len(counts) > 1:
            raise ProblemError(f"weights are for {' and '.join(map(str, sorted(counts)))} joints at once")

    def law(self, robot: Robot, ticks: Ticks, loop: Loop) -> Law:
        """The law along a reference; see `Controller`.

        Raises:
            ProblemError: the weights or the reference are for another number of joints; a joint has no motor, or no
                limit of torque; the Riccati equation has no solution.
        """
        expect_motors(expect_robot(robot), "a linear-quadratic regulator")
        nv, delay, reference = robot.nv, loop.delay, reference_of(robot, ticks, loop)
        weights, effort = self._weights(robot, delay)
        steps = loop_steps(plant_steps(robot, ticks), delay, loop.period)
        gains = _along(
            steps,
            weights,
            effort,
            used=np.r_[: 2 * nv, 2 * nv + np.flatnonzero(weights[2 * nv : 3 * nv]), 3 * nv : (3 + delay) * nv],
        )
        more = len(reference.q) - len(gains)
        columns = {
            "q": reference.q,
            "v": reference.v,
            "tau": reference.tau,
            "pending": np.hstack([np.empty((len(reference.q), 0)), *(_later(ticks, i, more) for i in range(delay))]),
            "K": np.vstack([gains.reshape(len(gains), -1), np.repeat(gains[-1:].reshape(1, -1), more, axis=0)]),
        }

        def torque(given: Readings) -> ca.SX:
            row = given.row
            x = ca.vertcat(row["q"] - given.q, row["v"] - given.v, given.integral, row["pending"] - given.pending)
            return row["tau"] + ca.reshape(row["K"], x.numel(), nv).T @ x

        at_goal = np.diag(gains[-1][:, 2 * nv : 3 * nv]).clip(min=0.0)
        return Law(law_function(nv, delay, columns, torque), table(columns), at_goal)

    def _weights(self, robot: Robot, delay: int) -> tuple[Array, Array]:
        """Diagonals of Q and R."""
        joints, limits = robot.joint_names, robot.limits
        half = (limits.effort_upper - limits.effort_lower) / 2
        if not np.all(np.isfinite(half)):
            raise ProblemError(
                f"a linear-quadratic regulator weighs errors against the limits of torque; {robot.name} has none at "
                f"{', '.join(np.array(joints)[~np.isfinite(half)])}: give effort_limit"
            )
        position, velocity, integral = (
            per_joint(value, joints, name, error=ProblemError) for name, value in vars(self).items()
        )
        x = np.concatenate([1 / position, velocity / position, integral / position, np.zeros(delay * robot.nv)])
        return x**2, 1 / half**2


def _along(steps: Steps, weights: Array, effort: Array, used: NDArray[np.intp]) -> Array:
    """Gains of the states that are used, zero of the others, shape (n, nv, m)."""
    gains = np.zeros((len(steps.A), effort.size, weights.size))
    part = Steps(steps.A[:, used[:, None], used], steps.B[:, used])
    gains[:, :, used] = best_gains(part, np.diag(weights[used]), np.diag(effort))
    return gains


def _later(ticks: Ticks, count: int, more: int) -> Array:
    """Mean torques of some ticks later, and the last row as often again [N m or N], shape (n + more, nv)."""
    rows = ticks.ahead(count)
    return np.vstack([rows, np.repeat(rows[-1:], more, axis=0)])
