"""Limits of the joints' jerks."""

from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.path_constraints.constraint import ConstraintReport
from armdyn.optimal.path_constraints.limits.rates import PartialLimit, accelerations
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages
from armdyn.trajectory import Trajectory


@dataclass(frozen=True)
class JerkLimit(PartialLimit):
    """No joint's acceleration changes faster than `problem.jerk_limit`; before and after the motion it is zero."""

    name = "jerk limits"
    continuous_torque = True

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return None if problem.jerk_limit is None else cls()

    def derivative_limit(self, problem: MinimumTimeProblem) -> tuple[int, Array]:
        return 3, self.part * np.asarray(problem.jerk_limit)

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Differences between the stages as parts of the limits; the accelerations at both ends."""
        return (
            StageRows(_jerks, numbers=problem.robot.nv),
            StageRows(_acceleration_at, (0,), where="first"),
            StageRows(_acceleration_at, (-1,), where="last"),
        )

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        own = RowValues(-self.part, self.part, 1 / np.asarray(problem.jerk_limit))
        return own, RowValues(0, 0), RowValues(0, 0)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check jerks by the time derivative of forward dynamics, within every sample."""
        t, _, jerks = accelerations(problem.robot, motion)
        return self._report_on_joints(problem.robot, 3, t, jerks, np.asarray(problem.jerk_limit))


def _jerks(stages: Stages, over_limit: ca.SX) -> ca.SX:
    steps = ca.repmat(ca.DM(np.diff(stages.c)).T, over_limit.numel(), 1)
    rises: ca.SX = (stages.a[:, 1:] - stages.a[:, :-1]) / (steps * stages.h)
    return ca.vec(rises * ca.repmat(over_limit, 1, steps.shape[1]))


def _acceleration_at(stages: Stages, numbers: ca.SX, stage: int) -> ca.SX:
    scaled: ca.SX = stages.a[:, stage] / stages.acceleration
    return scaled
