"""Limits of the joints' accelerations."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.optimal.path_constraints.constraint import Path
from armdyn.optimal.path_constraints.limits.rates import DerivativeLimit
from armdyn.optimal.path_constraints.rows import StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages


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
