"""Path constraints tightened for the collocation, so that the replay satisfies the originals; terminal correction."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from armdyn.arguments import expect
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.scene.collision import Clearance
from armdyn.optimal.constraints.constraint import ConstraintReport, PathConstraint, RequiredDistances
from armdyn.optimal.constraints.registry import path_constraints_of
from armdyn.optimal.constraints.rows import RowValues, StageRows, spread
from armdyn.optimal.constraints.stages import IntervalView
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.problem.task import Task
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class ConstraintReports:
    """Reports on a replay, one per path constraint.

    Attributes:
        each: report of every path constraint.
    """

    each: tuple[ConstraintReport, ...] = ()

    @property
    def reasons(self) -> tuple[str, ...]:
        """Violated constraints, in words."""
        return tuple(reason for report in self.each for reason in report.reasons)

    @property
    def slowing(self) -> float:
        """Factor on the duration that satisfies all on the same path; 1 if all are satisfied, inf if none does."""
        return max((report.slowing for report in self.each), default=1.0)

    @property
    def worst(self) -> Violation | None:
        """Largest violation; None without any."""
        found = [report.worst for report in self.each if report.worst is not None]
        return max(found, key=lambda worst: worst.value, default=None)

    @property
    def clearance(self) -> Clearance | None:
        """Smallest clearance; None without obstacles."""
        found = [report.clearance for report in self.each if report.clearance is not None]
        return min(found, key=lambda clearance: clearance.distance, default=None)


@dataclass(frozen=True, eq=False)
class Aim:
    """Offsets of a solve's via points and goal that cancel the misses of its replay.

    Attributes:
        offsets: offsets of q [rad or m], shape (legs, nv), or (nv,) for all legs.
        end_velocity: offset of the velocity at the goal [rad/s or m/s], shape (nv,).
    """

    offsets: Array | float = 0.0
    end_velocity: Array | float = 0.0

    def corrected(self, problem: MinimumTimeProblem, replay: Trajectory, passing: Array | None = None) -> Self:
        """Correct the offsets by a replay's misses at via points and goal.

        Args:
            problem: the original problem, with the true poses.
            replay: motion of the last solve, integrated.
            passing: times of the via points [s], shape (vias,); None: no via points.
        """
        vias = np.empty((0, problem.robot.nv)) if passing is None else replay(passing).q.reshape(-1, problem.robot.nv)
        missed = np.vstack([vias, replay.q[-1]]) - problem.poses[1:]
        return type(self)(
            np.broadcast_to(self.offsets, missed.shape) - missed,
            self.end_velocity - (replay.v[-1] - np.asarray(problem.v_goal)),
        )

    def at_goal(self, joints: int) -> Array:
        """Offset from the goal's state (q, v), shape (2 nv,)."""
        last = np.atleast_2d(self.offsets)[-1]
        return np.concatenate([np.broadcast_to(each, joints) for each in (last, self.end_velocity)])


@dataclass(frozen=True, eq=False)
class TightenedConstraints:
    """Tightened path constraints, and the correction of via points and goal.

    Attributes:
        path_constraints: the tightened path constraints.
        aim: terminal correction of via points and goal.
    """

    path_constraints: tuple[PathConstraint, ...] = ()
    aim: Aim = field(default_factory=Aim)

    @classmethod
    def of(cls, task: Task) -> Self:
        """Path constraints of a task's problem, not tightened."""
        numbers = task.policy.path_constraints
        return cls(tuple(constraint.under(numbers) for constraint in path_constraints_of(task.problem)))

    def required_distances(self, problem: MinimumTimeProblem) -> RequiredDistances | None:
        """Required distances between bodies; None without such a constraint."""
        found = (constraint.required_distances(problem) for constraint in self.path_constraints)
        return next((distances for distances in found if distances is not None), None)

    def derivative_limits(self, problem: MinimumTimeProblem) -> dict[int, Array]:
        """Tightened limits of the positions' derivatives by order, each of shape (nv,)."""
        return dict(limit for each in self.path_constraints if (limit := each.derivative_limit(problem)))

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of the program besides the equations of motion."""
        return tuple(rows for constraint in self.path_constraints for rows in constraint.rows(problem))

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        """Parameters and bounds of these rows.

        Raises:
            ProblemError: a constraint's values do not fit its rows.
        """
        return tuple(values for constraint in self.path_constraints for values in _values_of(constraint, problem))

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReports:
        """Check all path constraints along a motion; `passing`: times of the via points [s]."""
        reports = tuple(constraint.check(problem, motion, passing) for constraint in self.path_constraints)
        for constraint, report in zip(self.path_constraints, reports, strict=True):
            expect(report, ConstraintReport, f"result of {type(constraint).__name__}.check", "self.report(…)")
        return ConstraintReports(reports)

    def tightened(self, problem: MinimumTimeProblem, reports: ConstraintReports) -> Self:
        """Tighten each path constraint that the motion has violated."""
        pairs = zip(self.path_constraints, reports.each, strict=True)
        return replace(self, path_constraints=tuple(each.tightened(problem, report) for each, report in pairs))

    def aimed(self, problem: MinimumTimeProblem, replay: Trajectory, passing: Array) -> Self:
        """Correct via points and goal by the replay's misses."""
        return replace(self, aim=self.aim.corrected(problem, replay, passing))

    def on_finer_mesh(self) -> Self:
        """Path constraints and correction for a mesh twice as fine, with smaller misses."""
        return replace(self, path_constraints=tuple(each.on_finer_mesh() for each in self.path_constraints), aim=Aim())


def _values_of(constraint: PathConstraint, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
    """Parameters and bounds of a constraint's rows, checked against the rows.

    Raises:
        ProblemError: another number of rows or parameters.
    """
    values, sizes = constraint.values(problem), [rows.numbers for rows in constraint.rows(problem)]
    found = [one.numbers.size for one in values]
    if found != sizes:
        raise ProblemError(
            f"{type(constraint).__name__}.values returns RowValues with {found} numbers; its rows have {sizes}"
        )
    return values


def row_bounds(
    rows: Sequence[StageRows], values: Sequence[RowValues], place: IntervalView, intervals: int
) -> tuple[Array, Array]:
    """Lower and upper bounds of a program's rows besides the equations of motion, in their order."""
    sides = [spread(each, each.functions(place), own, (intervals,)) for each, own in zip(rows, values, strict=True)]
    lower, upper = zip(*sides, strict=True) if sides else ((), ())
    return np.concatenate([np.empty(0), *lower]), np.concatenate([np.empty(0), *upper])


def numbers_of(values: Sequence[RowValues]) -> Array:
    """Parameters of a program's rows."""
    return np.concatenate([np.empty(0), *(each.numbers for each in values)])
