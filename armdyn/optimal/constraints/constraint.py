"""Base classes of path constraints, and reports on motions.

The program satisfies a constraint at the points of a mesh (`rows`), the replay is checked everywhere
(`check`), and an excess between the points tightens the constraint (`tightened`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from armdyn.arguments import each, number, text
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.scene.collision import Clearance, CollisionModel
from armdyn.optimal.constraints.rows import StageRows
from armdyn.optimal.problem.planning_limits import PathConstraintSpec
from armdyn.optimal.problem.policy.refinement import PathConstraintPolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class ConstraintReport:
    """Report on a motion and a path constraint, checked along the whole motion.

    Attributes:
        name: name of the constraint.
        said: the largest value in words, with units.
        share: the largest value over its limit; None if nothing is limited.
        reasons: the violations in words; empty: the constraint is satisfied.
        worst: the largest violation; None: the constraint is satisfied.
        missed: data for `tightened`, specific to the constraint.
        clearance: the smallest clearance; None for other constraints.
        order: power of the duration with which the share falls on the same path: 1 of a speed, 2 of an acceleration, 3
            of a jerk; 0: slowing down does not help.
    """

    name: str
    said: str
    share: float | None = None
    reasons: tuple[str, ...] = ()
    worst: Violation | None = None
    missed: Array = field(default_factory=lambda: np.empty(0))
    clearance: Clearance | None = None
    order: int = 0

    @property
    def slowing(self) -> float:
        """Factor on the duration that satisfies the constraint on the same path; 1 if satisfied, inf if none does."""
        if not self.reasons:
            return 1.0
        return self.share ** (1 / self.order) if self.order and self.share else np.inf


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
class RequiredDistances:
    """Distances that pairs of bodies must keep.

    Attributes:
        model: collision model of the scene.
        clearance: least distance of every pair [m].
        most: largest distance that can be required of each pair [m], shape (pairs,); less for pairs that touch at a
            given pose.
        places: parts of every leg's duration at which distances are required, besides evenly spaced ones.
    """

    model: CollisionModel
    clearance: float
    most: Array
    places: tuple[Array, ...]


@dataclass(frozen=True)
class PathConstraint(PathConstraintSpec, ABC):
    """Path constraint, possibly tightened.

    A frozen dataclass; `tightened` returns another. Only `check` must be implemented.

    Attributes:
        policy: tuned numbers of path constraints.
        option: name in `--limit NAME=…`; empty: no such option.
        metavar: placeholder of the value in the help.
        help: one line of that help.
    """

    policy: PathConstraintPolicy = field(default=PathConstraintPolicy(), kw_only=True, repr=False, compare=False)

    option: ClassVar[str] = ""
    metavar: ClassVar[str] = "X"
    help: ClassVar[str] = ""

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        """Constraint from the problem's own argument for it; None without one."""
        return None

    @classmethod
    def of_option(cls, values: list[float], frame: str | None = None) -> Self:
        """Constraint from `--limit NAME=VALUES[@FRAME]`.

        Raises:
            ProblemError: too many values, a frame for a constraint without frames, or a constraint without an option.
        """
        raise ProblemError(f"{cls.__name__} has no option --limit; it is made in Python")

    @classmethod
    def _option_parts(cls, values: object, frame: object) -> tuple[list[float], str | None]:
        """The arguments of `of_option`, checked.

        Raises:
            ProblemError: `values` are no numbers, or `frame` is no text.
        """
        found = list(each(values, f"values of --limit {cls.option}", number, finite=False))
        if not found:
            raise ProblemError(f"values of --limit {cls.option} are none; give a number")
        return found, None if frame is None else text(frame, f"frame of --limit {cls.option}")

    def derivative_limit(self, problem: MinimumTimeProblem) -> tuple[int, Array] | None:
        """Order of the limited derivative of q, 2 or 3, and its limits, shape (nv,); None for other constraints.

        Curves satisfy these by their control points, everywhere, without rows.
        """
        return None

    def torque_rate_limit(self, problem: MinimumTimeProblem) -> Array | None:
        """Limits of torque rates [N m/s or N/s], shape (nv,); None for other constraints.

        Curves satisfy these between consecutive torques, without rows.
        """
        return None

    def required_distances(self, problem: MinimumTimeProblem) -> RequiredDistances | None:
        """Required distances between bodies, which curves satisfy without rows; None for other constraints."""
        return None

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of the constraint in the program, as tight as the constraint is."""
        return ()

    def report(
        self, share: float, words: str, reason: str, worst: tuple[str, str, float], name: str = "", order: int = 1
    ) -> ConstraintReport:
        """Report on the largest value of the limited quantity.

        Args:
            share: the value over its limit.
            words: the value in words, with units.
            reason: the violation in words, if there is one.
            worst: the violated limit, its joint or frame, and the time [s].
            name: name in the report; empty: the constraint's.
            order: see `ConstraintReport`.
        """
        name = name or self.name
        if share <= 1 + self.policy.tolerance:
            return ConstraintReport(name, words, share, order=order)
        return ConstraintReport(name, words, share, (reason,), Violation(*worst, share - 1), order=order)

    def _report_of_joints(
        self,
        problem: MinimumTimeProblem,
        used: Array,
        t: Array,
        words: Callable[[int, int], str],
        limit: str,
        order: int = 1,
    ) -> ConstraintReport:
        """Report on the joint and sample at which most of a limit is used.

        Args:
            problem: the problem.
            used: values over their limits, shape (samples, nv).
            t: times of the samples [s], shape (samples,).
            words: the value of a sample and a joint in words, with units.
            limit: name of the limit.
            order: see `ConstraintReport`.
        """
        k, i = np.unravel_index(np.argmax(used), used.shape)
        share, joint, when = float(used[k, i]), problem.robot.joint_names[i], float(t[k])
        at = f"at t = {when:.4g} s"
        reason = f"joint {joint!r} exceeds its {limit} by {100 * (share - 1):.2g} % {at}"
        said = f"{words(int(k), int(i))}, by {joint!r} {at}"
        return self.report(share, said, reason, (limit, joint, when), order=order)

    @abstractmethod
    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check a motion along its whole duration, independently of the collocation.

        Args:
            problem: the problem.
            motion: a replay, with consistent torques and states.
            passing: times of the via points [s], shape (vias,).
        """

    def tightened(self, problem: MinimumTimeProblem, report: ConstraintReport) -> Self:
        """The constraint, tightened where a motion violated it between the points; itself where it is tight enough."""
        return self

    def least_duration(self, problem: MinimumTimeProblem, q: Array, dq: Array, ddq: Array) -> float:
        """Shortest duration [s] of an initial guess along a path over s from 0 to 1; 0: no constraint.

        Args:
            problem: the problem.
            q: joint positions [rad or m], shape (samples, nv).
            dq: dq/ds, shape (samples, nv).
            ddq: d²q/ds², shape (samples, nv).
        """
        return 0.0


@dataclass(frozen=True)
class PartialLimit(PathConstraint):
    """Limit of a rate; the program satisfies a part of it, so that the replay satisfies the whole between the points.

    Attributes:
        part: part of the limit in the program, lowered by `tightened`.
    """

    part: float = field(default=1.0, kw_only=True)

    def tightened(self, problem: MinimumTimeProblem, report: ConstraintReport) -> Self:
        """Lower the limit by the replay's excess; raise it again if the replay stays below."""
        spare = self.policy.rate_tightening if report.reasons else 0.0
        part = (1 - spare) * self.part / max(float(report.share or 1), 1e-6)
        fitting = float(np.clip(part, self.policy.least_part, 1))
        changed = fitting != self.part and (report.reasons or fitting > self.part)
        return replace(self, part=fitting) if changed else self
