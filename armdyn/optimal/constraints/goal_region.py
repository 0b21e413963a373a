"""Regions that a frame reaches: the goal's, and via points.

The mesh is distributed over the legs between via points, whose end knots have equal bounds (`legs`), so that poses need
no rows; the replay's misses are corrected by offsets. Where legs meet in a region, curves share a free control point.
"""

from dataclasses import dataclass, field, replace
from typing import Self

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import DIRECTIONS, GoalPose, deviations_of, moving_directions
from armdyn.optimal.constraints.constraint import ConstraintReport, PathConstraint
from armdyn.optimal.constraints.rows import RowValues, StageRows, Where
from armdyn.optimal.constraints.stages import Stages
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.reprs import joint_unit
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


_CHECKS = 41
"""Number of a replay's samples around the planned time among which the passage of a region is searched."""


@dataclass(frozen=True)
class ViaPoints(PathConstraint):
    """The motion passes through `problem.via`.

    Attributes:
        parts: parts of the regions' tolerances in the program; empty: the whole tolerances.
    """

    parts: tuple[float, ...] = field(default=(), kw_only=True)

    name = "via points"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return cls() if problem.via else None

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows at the ends of legs in regions."""
        return tuple(region_rows(problem.robot, one, "last", leg) for leg, one in problem.via_regions.items())

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        parts = self.parts or np.ones(len(problem.via))
        return tuple(region_values(problem.robot, one, parts[leg]) for leg, one in problem.via_regions.items())

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check the distance from each via point: of a pose at its time, of a region at the nearest time."""
        reasons, worst, errors = list[str](), list[Violation](), []
        for i, (via, time) in enumerate(zip(problem.via, passing, strict=True)):
            if isinstance(via, GoalPose):
                error, time, which = _nearest_deviation(problem, motion, via, float(time))
                enough, unit = self.policy.region_excess, "rad" if which.startswith("r") else "m"
                miss = f"{error:.2g} {unit} outside the region of via[{i}], in {which}"
            else:
                distance = np.abs(motion(time).q - np.asarray(via))
                error, which = float(np.max(distance)), problem.robot.joint_names[int(np.argmax(distance))]
                miss = f"{error:.2g} {joint_unit(problem.robot.slides)} off via point {i}"
                enough = self.policy.near
            errors.append(error)
            if error > enough:
                reasons.append(f"it passes {miss}")
                worst.append(Violation(f"via point {i}", which, float(time), error))
        times = ", ".join(f"{t:.4f}" for t in passing)
        words = f"at {times} s, within {max(max(errors), 0.0):.1e} rad" + (" or m" if problem.via_regions else "")
        most = max(worst, key=lambda one: one.value, default=None)
        return ConstraintReport(self.name, words, None, tuple(reasons), most, np.array(errors))

    def tightened(self, problem: MinimumTimeProblem, report: ConstraintReport) -> Self:
        """Lower a region's tolerance if the replay passed outside."""
        parts = list(self.parts or np.ones(len(problem.via)))
        for i, region in problem.via_regions.items():
            given = region.deviations[(region.deviations > 0) & np.isfinite(region.deviations)]
            if report.missed[i] > self.policy.region_excess and given.size:
                parts[i] = max(parts[i] - 2 * float(report.missed[i]) / float(np.min(given)), 0.0)
        return replace(self, parts=tuple(parts))


def _nearest_deviation(
    problem: MinimumTimeProblem, motion: Trajectory, region: GoalPose, passing: float
) -> tuple[float, float, str]:
    """Smallest deviation of a motion from a region [m or rad], its time [s], and its direction.

    The time is the one around the planned time with the least deviations over the tolerances.
    """
    k = int(np.clip(np.searchsorted(motion.t, passing), 1, motion.t.size - 1))
    step = motion.t[k] - motion.t[k - 1]
    most = region.deviations
    time, scale = passing, np.where((most > 0) & np.isfinite(most), most, 1e-3)
    for width in (step, 2 * step / (_CHECKS - 1)):
        times = np.clip(time + width * np.linspace(-1, 1, _CHECKS), motion.t[0], motion.t[-1])
        over = np.abs(deviations_of(problem.robot, region, motion(times).q)) - most
        best = int(np.argmin(np.max(over / scale, axis=1)))
        time = float(times[best])
    which = int(np.argmax(over[best]))
    return float(over[best, which]), time, DIRECTIONS[which]
