"""Limits of the joints' jerks."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.optimal.path_constraints.limits.rates import DerivativeLimit
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages


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
