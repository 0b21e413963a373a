"""Via points: poses and regions that are passed in order, at any time and velocity.

The mesh is distributed over the legs between via points, whose end knots have equal bounds (`legs`), so that poses need
no rows; the replay's misses are corrected by offsets. Where legs meet in a region, curves share a free control point.
"""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.models.scene.reaching import DIRECTIONS, GoalPose, deviations_of
from armdyn.optimal.path_constraints.constraint import ConstraintReport, PathConstraint
from armdyn.optimal.path_constraints.goal_region import region_rows, region_values
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.trajectory import Trajectory

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
                enough, miss = self.policy.near, f"{error:.2g} rad off via point {i}"
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
