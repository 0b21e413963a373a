"""Goal region: rows that bring a frame into the region of a `GoalPose`."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import GoalPose, moving_directions
from armdyn.optimal.path_constraints.constraint import ConstraintReport, PathConstraint
from armdyn.optimal.path_constraints.rows import RowValues, StageRows, Where
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages
from armdyn.trajectory import Trajectory

_LEAST = 1e-2
"""Least scale of deviations [m or rad], which prices the program's violations: a tip travels this far in 10 ms."""


@dataclass(frozen=True)
class GoalRegion(PathConstraint):
    """The last joint positions bring a frame into the region of a goal pose.

    Attributes:
        goal: the region.
    """

    goal: GoalPose

    name = "goal region"

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of the last interval."""
        return (region_rows(problem.robot, self.goal, "last"),)

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        """Zero, or the tolerance in both directions."""
        return (region_values(problem.robot, self.goal),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: np.ndarray) -> ConstraintReport:
        """Report without a check: the end found becomes the goal, which is checked separately."""
        return ConstraintReport(self.name, "the end is chosen within the region")


def region_rows(
    robot: Robot, goal: GoalPose, where: Where, leg: int | None = None, stages: tuple[int, ...] = (-1,)
) -> StageRows:
    """Rows of a frame's deviations from a goal, over the tolerances.

    Args:
        robot: the arm.
        goal: the region.
        where: intervals with rows.
        leg: index of the leg; None: the whole motion.
        stages: indices of the interval's stages.
    """
    limited = _limited(robot, goal)
    return StageRows(_deviations, (goal.frame, limited, goal.axis, stages), 12 + len(limited), where, leg)


def region_values(robot: Robot, goal: GoalPose, part: float = 1.0, stages: int = 1) -> RowValues:
    """Parameters of `region_rows` and their bounds: a part of the tolerances in both directions."""
    limited, pose = list(_limited(robot, goal)), goal.pose
    most = goal.deviations[limited]
    scale = np.maximum(most, _LEAST)
    bound = np.tile(part * most / scale, stages)
    return RowValues(-bound, bound, np.concatenate([pose.rotation.ravel(order="F"), pose.translation, 1 / scale]))


def _limited(robot: Robot, goal: GoalPose) -> tuple[int, ...]:
    """Limited directions, of x, y, z, rx, ry, rz, in which the frame can move."""
    return tuple(np.flatnonzero(np.isfinite(goal.deviations) & moving_directions(robot, goal)).tolist())


def _deviations(
    stages: Stages,
    numbers: ca.SX,
    frame: str,
    limited: tuple[int, ...],
    axis: int | None,
    at: tuple[int, ...],
) -> ca.SX:
    """Deviations from a goal at stages of an interval, as in `GoalPose`, over scales.

    Args:
        stages: stages of the interval.
        numbers: rotation, column by column, and position of the goal, one over the scales, shape (12 + rows,).
        frame: name of the frame.
        limited: directions with rows, in order.
        axis: index of the axis about which the frame may turn.
        at: indices of the stages.
    """
    n = stages.dynamics.nv
    q, pose = ca.SX.sym("q", n), ca.SX.sym("pose", 12)
    back = ca.reshape(pose[:9], 3, 3).T
    rotation, origin = stages.dynamics.frame_placement(q, frame)
    turned = back @ rotation
    if axis is None:
        across = ca.vertcat(*(turned[k, j] - turned[j, k] for j, k in ((1, 2), (2, 0), (0, 1)))) / 2
        cosine = (ca.trace(turned) - 1) / 2
    else:
        across, cosine = ca.cross(ca.DM.eye(3)[:, axis], turned[:, axis]), turned[axis, axis]
    sine = ca.sqrt(ca.sumsqr(across) + 1e-20)  # differentiable at zero deviation
    deviations = ca.vertcat(back @ (origin - pose[9:]), across * ca.atan2(sine, cosine) / sine)
    one = ca.Function("deviations", [q, pose], [ca.vertcat(*(deviations[k] for k in limited))])
    return ca.vertcat(*(one(stages.q[:, k], numbers[:12]) * numbers[12:] for k in at))
