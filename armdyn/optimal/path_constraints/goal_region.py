"""End of a motion within the region of a goal pose, as rows of a program whose end is free."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.path_constraints.constraint import ConstraintReport, Knots, PathConstraint
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages
from armdyn.trajectory import Trajectory


@dataclass(frozen=True)
class GoalRegion(PathConstraint):
    """The last joint positions bring a frame into the region of a goal pose: the program chooses where.

    Attributes:
        goal: the region.
    """

    goal: GoalPose

    name = "goal region"

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of the last interval."""
        return (StageRows(_deviations, (self.goal.frame, self._limited, self.goal.axis), numbers=12, where="last"),)

    def values(self, problem: MinimumTimeProblem, knots: Knots) -> tuple[RowValues, ...]:
        """Zero, or the tolerance either way."""
        most, pose = self.goal.deviations[list(self._limited)], self.goal.pose
        numbers = np.concatenate([pose.rotation.ravel(order="F"), pose.translation])
        return (RowValues(-most, most, numbers),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: np.ndarray) -> ConstraintReport:
        """Nothing: the end found is brought onto the region and becomes the goal of what is solved and checked."""
        return ConstraintReport(self.name, "the end is chosen within the region")

    @property
    def _limited(self) -> tuple[int, ...]:
        """Directions with a limit, of x, y, z, rx, ry, rz."""
        return tuple(np.flatnonzero(np.isfinite(self.goal.deviations)).tolist())


def _deviations(stages: Stages, pose: ca.SX, frame: str, limited: tuple[int, ...], axis: int | None) -> ca.SX:
    """Deviations from a goal at the end of an interval, as `GoalPose` defines them [m, rad].

    Args:
        stages: of the interval.
        pose: rotation, column by column, and position of the goal, shape (12,).
        frame: that is to be there.
        limited: directions that have rows, in their order.
        axis: number of the axis about which the frame may turn.
    """
    back = ca.reshape(pose[:9], 3, 3).T
    rotation, origin = stages.dynamics.frame_placement(stages.q[:, -1], frame)
    turned = back @ rotation
    if axis is None:
        across = ca.vertcat(*(turned[k, j] - turned[j, k] for j, k in ((1, 2), (2, 0), (0, 1)))) / 2
        cosine = (ca.trace(turned) - 1) / 2
    else:
        across, cosine = ca.cross(ca.DM.eye(3)[:, axis], turned[:, axis]), turned[axis, axis]
    sine = ca.sqrt(ca.sumsqr(across) + 1e-20)  # differentiable where there is no deviation
    deviations = ca.vertcat(back @ (origin - pose[9:]), across * ca.atan2(sine, cosine) / sine)
    column: ca.SX = ca.vertcat(*(deviations[k] for k in limited))
    return column
