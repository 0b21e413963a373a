"""Limits of the joints' accelerations and jerks."""

from dataclasses import dataclass
from typing import ClassVar, Self

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.path_constraints.constraint import ConstraintReport, Path
from armdyn.optimal.path_constraints.limits.rates import PartialLimit, accelerations
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages
from armdyn.trajectory import Trajectory

_DERIVATIVES = {2: ("acceleration", "²"), 3: ("jerk", "³")}


@dataclass(frozen=True)
class DerivativeLimit(PartialLimit):
    """Limits of a derivative of the joint positions, from an argument of the problem.

    Attributes:
        order: order of the derivative: 2, acceleration, or 3, jerk.
    """

    order: ClassVar[int]

    @classmethod
    def limits(cls, problem: MinimumTimeProblem) -> Array | None:
        """The derivative's limits [rad/s² or m/s², or rad/s³ or m/s³], shape (nv,); None: no limits."""
        given = getattr(problem, f"{_DERIVATIVES[cls.order][0]}_limit")
        return None if given is None else np.asarray(given)

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return None if cls.limits(problem) is None else cls()

    def derivative_limit(self, problem: MinimumTimeProblem) -> tuple[int, Array]:
        return self.order, self.part * np.asarray(self.limits(problem))

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        return (RowValues(-self.part, self.part, 1 / np.asarray(self.limits(problem))),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check accelerations by forward dynamics, and their time derivatives, within every sample."""
        robot, limits, (kind, power) = problem.robot, np.asarray(self.limits(problem)), _DERIVATIVES[self.order]
        t, *rates = accelerations(robot, motion)
        seen = np.abs(rates[self.order - 2]).reshape(-1, robot.nv)
        k, i = np.unravel_index(np.argmax(seen / limits), seen.shape)
        share, joint, when = float(seen[k, i] / limits[i]), robot.joint_names[i], float(t.ravel()[k])
        unit = f"{'m' if robot.slides[i] else 'rad'}/s{power}"
        words = f"{seen[k, i]:.5g} of {limits[i]:.5g} {unit} at most, by {joint!r} at t = {when:.4g} s"
        reason = f"joint {joint!r} exceeds its {kind} limit by {100 * (share - 1):.2g} % at t = {when:.4g} s"
        return self.report(share, words, reason, (f"{kind} limit", joint, when), order=self.order)


@dataclass(frozen=True)
class AccelerationLimit(DerivativeLimit):
    """No joint accelerates by more than `problem.acceleration_limit`."""

    name = "acceleration limits"
    order = 2

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of accelerations at the stages of every interval, over the limits."""
        return (StageRows(_accelerations, numbers=problem.robot.nv),)

    def least_duration(self, problem: MinimumTimeProblem, path: Path) -> float:
        return float(np.sqrt(np.max(np.abs(path.ddq) / np.asarray(problem.acceleration_limit))))


def _accelerations(stages: Stages, over_limit: ca.SX) -> ca.SX:
    return ca.vec(stages.a * ca.repmat(over_limit, 1, stages.a.shape[1]))


@dataclass(frozen=True)
class JerkLimit(DerivativeLimit):
    """No joint's jerk exceeds `problem.jerk_limit`; before and after the motion the acceleration is zero."""

    name = "jerk limits"
    order = 3
    continuous_torque = True

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Differences of accelerations between stages over the limits; the accelerations at both ends."""
        return (
            StageRows(_jerks, numbers=problem.robot.nv),
            StageRows(_acceleration_at, (0,), where="first"),
            StageRows(_acceleration_at, (-1,), where="last"),
        )

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        return *super().values(problem), RowValues(0, 0), RowValues(0, 0)


def _jerks(stages: Stages, over_limit: ca.SX) -> ca.SX:
    steps = ca.repmat(ca.DM(np.diff(stages.c)).T, over_limit.numel(), 1)
    rises: ca.SX = (stages.a[:, 1:] - stages.a[:, :-1]) / (steps * stages.h)
    return ca.vec(rises * ca.repmat(over_limit, 1, steps.shape[1]))


def _acceleration_at(stages: Stages, numbers: ca.SX, stage: int) -> ca.SX:
    scaled: ca.SX = stages.a[:, stage] / stages.acceleration
    return scaled
