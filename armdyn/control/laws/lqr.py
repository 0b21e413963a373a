"""A linear-quadratic regulator that varies along the reference."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import Sign, number
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

_WEIGHTS = ("position", "velocity", "integral")


@dataclass(frozen=True)
class Lqr:
    """tau = tau_ref + K (e, ė, ∫e dt, tau_ref - tau of what is decided and not yet felt), with K of each tick.

    K makes least Σ s² (|e|² + |velocity ė|² + |integral ∫e dt|²)/position² + |u|²/(half the torque range)² over the
    ticks, of an arm that is linear about the reference and of a loop with its delay; s is `on_the_way` until the
    reference ends, and then 1 for good. The integral runs from there on, too.

    The defaults are for least settled time, and one rule for every arm. An error on the way costs nothing by itself,
    and a fast motion leaves little torque to mend it: gains that are as high there as at the goal clip the torque, and
    what one joint then lacks throws the others off.

    Attributes:
        position: error that is worth half of a joint's torque range, [rad] of a revolute joint and [m] of a prismatic
            one: one number, or one per joint.
        velocity: what a velocity error counts beside a position error [s], likewise.
        integral: likewise, of the error's integral [1/s]; 0: the integral is not used.
        on_the_way: what errors count before the reference ends, beside what they count at its end.

    Raises:
        ProblemError: position not positive, others negative, something not finite; counts that do not agree.
    """

    position: PerJoint = 0.04
    velocity: PerJoint = 0.008
    integral: PerJoint = 0.5
    on_the_way: float = 0.15

    def __post_init__(self) -> None:
        set_own = object.__setattr__
        set_own(self, "on_the_way", number(self.on_the_way, "on_the_way", sign="not negative"))
        counts = set()
        for name in _WEIGHTS:
            value = getattr(self, name)
            sign: Sign = "positive" if name == "position" else "not negative"
            array = per_joint(value, None, name, error=ProblemError, sign=sign)
            set_own(self, name, float(array) if array.ndim == 0 else tuple(map(float, array)))
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
        moving = np.arange(len(ticks.q)) / ticks.rate < ticks.duration
        moving[-1] = False
        steps = loop_steps(plant_steps(robot, ticks), delay, np.where(moving, 0.0, loop.period))
        gains = _along(steps, weights, effort, np.where(moving, self.on_the_way**2, 1.0))
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
        return Law(law_function(nv, delay, columns, torque), table(columns), at_goal, ticks.duration)

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
            per_joint(getattr(self, name), joints, name, error=ProblemError) for name in _WEIGHTS
        )
        x = np.concatenate([1 / position, velocity / position, integral / position, np.zeros(delay * robot.nv)])
        return x**2, 1 / half**2


def _along(steps: Steps, weights: Array, effort: Array, share: Array) -> Array:
    """Gains, shape (n, nv, m); zero of integrals that do not count, which nothing could lead to rest."""
    nv, m = effort.size, weights.size
    unused = 2 * nv + np.flatnonzero(weights[2 * nv : 3 * nv] == 0)
    used = np.setdiff1d(np.arange(m), unused)
    part = Steps(steps.A[:, used[:, None], used], steps.B[:, used])
    gains = np.zeros((len(steps.A), nv, m))
    gains[:, :, used] = best_gains(part, np.diag(weights[used]), np.diag(effort), share)
    return gains


def _later(ticks: Ticks, count: int, more: int) -> Array:
    """Mean torques of some ticks later, and the last row as often again [N m or N], shape (n + more, nv)."""
    rows = ticks.ahead(count)
    return np.vstack([rows, np.repeat(rows[-1:], more, axis=0)])
