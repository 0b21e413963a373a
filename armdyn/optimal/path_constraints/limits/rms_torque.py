"""Limits of the continuous torque: root mean square, which heats a motor, over the motion and the dwell after it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import number, numbers
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.models.values.per_joint import per_joint
from armdyn.optimal.path_constraints.constraint import ConstraintReport
from armdyn.optimal.path_constraints.limits.rates import PartialLimit
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages
from armdyn.parsing.numbers import number as parsed
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory


@brief
@dataclass(frozen=True, eq=False)
class RmsTorque(PartialLimit):
    """Limit of each joint's root mean square of the torque over the motion and a dwell at the goal.

    ∫ τ² dt + dwell τ_h² ≤ limit² (T + dwell); in the dwell the motors hold the arm with the torque τ_h. Gravity and
    friction are part of τ.

    Attributes:
        limit: continuous torque [N m or N]: one number, or one per joint; inf for none.
        dwell: time at rest at the goal [s].
    """

    limit: ArrayLike
    dwell: float = 0.0

    name = "continuous-torque limits"
    option, metavar, help = (
        "rms-torque",
        "L[,L…][@DWELL]",
        "root mean square of the torques [N m] over the motion and a dwell [s], one number or one per joint",
    )

    def __post_init__(self) -> None:
        numbers(self.limit, "RmsTorque limit", "one number, or one per joint [N m]")
        number(self.dwell, "RmsTorque dwell", unit="s", sign="not negative")

    @classmethod
    def of_option(cls, values: list[float], frame: str | None) -> Self:
        """Parse the option: one number, or one per joint; after @ the dwell."""
        dwell = 0.0 if frame is None else parsed(frame.removesuffix("s"), f"--limit {cls.option}: the dwell after @")
        return cls(values[0] if len(values) == 1 else values, dwell)

    def option_text(self) -> str:
        """Text of the constraint for its option, with all digits."""
        dwell = f"@{float(self.dwell)!r}" if self.dwell else ""
        return f"{self.option}={','.join(map(repr, np.ravel(self.limit).tolist()))}{dwell}"

    def on(self, robot: Robot, start: Array, goal: Array) -> Self:
        """Expand the limit to one number per joint, and check that the goal of a dwell is at rest."""
        limit = per_joint(
            self.limit,
            robot.joint_names,
            "RmsTorque limit",
            unit="N m",
            error=ProblemError,
            finite=False,
            sign="positive",
        )
        if self.dwell and np.any(goal[robot.nv :]):
            raise ProblemError(f"RmsTorque has a dwell of {self.dwell:g} s at the goal, where the arm is in flight")
        return replace(self, limit=limit)

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """∫ ((τ/limit)² - part²) dt [s] of every joint."""
        return (StageRows(_surplus, numbers=problem.robot.nv + 1, where="sum"),)

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        square = self.part**2
        left = self.dwell * (square - self._held(problem))
        return (RowValues(-np.inf, left, np.append(np.asarray(self.limit, dtype=float) ** -2, square)),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check the integral of the replay's torques, linear between samples."""
        tau, steps = motion.tau / np.asarray(self.limit), np.diff(motion.t)
        heat = steps @ (tau[1:] ** 2 + tau[1:] * tau[:-1] + tau[:-1] ** 2) / 3 + self.dwell * self._held(problem)
        used = np.sqrt(heat / (motion.duration + self.dwell))
        i = int(np.argmax(used))
        share, joint, most = float(used[i]), problem.robot.joint_names[i], float(np.asarray(self.limit)[i])
        words = f"{share * most:.5g} of {most:.5g} {'N' if problem.robot.slides[i] else 'N m'} at most, by {joint!r}"
        reason = f"the root mean square of the torque of joint {joint!r} exceeds its limit by {100 * (share - 1):.2g} %"
        return self.report(share, words, reason, ("continuous-torque limit", joint, float(motion.t[-1])))

    def _held(self, problem: MinimumTimeProblem) -> Array:
        """Squared holding torques at the goal over squared limits, shape (nv,)."""
        return np.asarray(problem.holding_torque() / np.asarray(self.limit)) ** 2


def _surplus(stages: Stages, numbers: ca.SX) -> ca.SX:
    """∫ ((τ/limit)² - part²) dt over an interval, in which the torque is linear."""
    slope = (stages.tau[:, -1] - stages.tau[:, 0]) / float(stages.c[-1] - stages.c[0])
    first = stages.tau[:, 0] - float(stages.c[0]) * slope
    last = first + slope
    surplus: ca.SX = stages.h * ((first**2 + first * last + last**2) / 3 * numbers[:-1] - numbers[-1])
    return surplus
