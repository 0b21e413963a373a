"""Limits of the joints' accelerations."""

from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.path_constraints.constraint import ConstraintReport, Path
from armdyn.optimal.path_constraints.limits.rates import PartialLimit, accelerations
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages
from armdyn.trajectory import Trajectory


@dataclass(frozen=True)
class AccelerationLimit(PartialLimit):
    """No joint accelerates by more than `problem.acceleration_limit`."""

    name = "acceleration limits"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return None if problem.acceleration_limit is None else cls()

    def derivative_limit(self, problem: MinimumTimeProblem) -> tuple[int, Array]:
        return 2, self.part * np.asarray(problem.acceleration_limit)

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of accelerations at the stages of every interval, over the limits."""
        return (StageRows(_accelerations, numbers=problem.robot.nv),)

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        return (RowValues(-self.part, self.part, 1 / np.asarray(problem.acceleration_limit)),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check accelerations by forward dynamics, within every sample."""
        t, a, _ = accelerations(problem.robot, motion)
        return self._report_on_joints(problem.robot, 2, t, a, np.asarray(problem.acceleration_limit))

    def least_duration(self, problem: MinimumTimeProblem, path: Path) -> float:
        return float(np.sqrt(np.max(np.abs(path.ddq) / np.asarray(problem.acceleration_limit))))


def _accelerations(stages: Stages, over_limit: ca.SX) -> ca.SX:
    return ca.vec(stages.a * ca.repmat(over_limit, 1, stages.a.shape[1]))
