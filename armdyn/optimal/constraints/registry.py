"""Path constraints of a problem: their registry, and all of them together, tightened for the program.

To add a path constraint: write its class, and its line in `PATH_CONSTRAINTS`.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.arguments import expect
from armdyn.arrays import Array
from armdyn.errors import ProblemError, did_you_mean
from armdyn.optimal.constraints.clearance import ClearanceConstraint
from armdyn.optimal.constraints.constraint import ConstraintReport, ConstraintReports, PathConstraint, RequiredDistances
from armdyn.optimal.constraints.rate_limits import AccelerationLimit, FrameSpeedLimit, JerkLimit, VelocityTaperLimit
from armdyn.optimal.constraints.regions import FrameRegion, ViaPoints
from armdyn.optimal.constraints.rows import StageRows
from armdyn.optimal.constraints.torque_limits import RmsTorque, TorqueRateLimit, TorqueSpeedLimit
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.task import Task
from armdyn.parsing.numbers import numbers
from armdyn.trajectory import Trajectory

PATH_CONSTRAINTS: tuple[type[PathConstraint], ...] = (
    ClearanceConstraint,
    ViaPoints,
    AccelerationLimit,
    JerkLimit,
    FrameSpeedLimit,
    FrameRegion,
    TorqueRateLimit,
    VelocityTaperLimit,
    TorqueSpeedLimit,
    RmsTorque,
)


def path_constraints_of(problem: MinimumTimeProblem) -> tuple[PathConstraint, ...]:
    """All path constraints of a problem: those that its other arguments imply, such as `via`, and `path_constraints`.

    Raises:
        ProblemError: one of `path_constraints` does not derive from `PathConstraint`.
    """
    implied = (kind.from_problem(problem) for kind in PATH_CONSTRAINTS)
    found = [constraint for constraint in implied if constraint is not None]
    for constraint in problem.path_constraints:
        if not isinstance(constraint, PathConstraint):
            raise ProblemError(f"{constraint!r} has a name, but no rows and no check: derive it from PathConstraint")
        found.append(constraint)
    return tuple(found)


def options() -> dict[str, type[PathConstraint]]:
    """Path constraints with an option `--limit NAME=…`, by name."""
    return {kind.option: kind for kind in PATH_CONSTRAINTS if kind.option}


def path_constraint_from(text: str) -> PathConstraint:
    """Parse a path constraint from a text such as "tip-speed=0.25@tool0".

    Raises:
        ProblemError: no limit has this name, and the message has the nearest one; or the text is invalid. The message
            refers to --limit.
    """
    name, equals, rest = text.partition("=")
    known, called = options(), name.strip()
    if called not in known:
        hint = did_you_mean(called, known) or f"; known: {', '.join(known)}"
        raise ProblemError(f"--limit: no limit is called {called!r}{hint}")
    kind = known[called]
    values, at, frame = rest.partition("@")
    if not equals or (at and not frame.strip()):
        raise ProblemError(f"--limit {text!r}: write {name}={kind.metavar}, with numbers")
    return kind.of_option(numbers(values, f"--limit {name}"), frame.strip() or None)


@dataclass(frozen=True, eq=False)
class TightenedConstraints:
    """Tightened path constraints, and offsets of via points and goal that cancel the misses of a replay.

    Attributes:
        path_constraints: the tightened path constraints.
        offsets: offsets of q at via points and goal [rad or m], shape (legs, nv), or a number for all.
        end_velocity: offset of the velocity at the goal [rad/s or m/s], shape (nv,).
    """

    path_constraints: tuple[PathConstraint, ...] = ()
    offsets: Array | float = 0.0
    end_velocity: Array | float = 0.0

    @classmethod
    def of(cls, task: Task) -> Self:
        """Path constraints of a task's problem, not tightened."""
        numbers = task.policy.path_constraints
        return cls(tuple(replace(constraint, policy=numbers) for constraint in path_constraints_of(task.problem)))

    def required_distances(self, problem: MinimumTimeProblem) -> RequiredDistances | None:
        """Required distances between bodies; None without such a constraint."""
        found = (constraint.required_distances(problem) for constraint in self.path_constraints)
        return next((distances for distances in found if distances is not None), None)

    def derivative_limits(self, problem: MinimumTimeProblem) -> dict[int, Array]:
        """Tightened limits of the positions' derivatives by order, each of shape (nv,)."""
        return dict(limit for each in self.path_constraints if (limit := each.derivative_limit(problem)))

    def torque_rates(self, problem: MinimumTimeProblem) -> Array | None:
        """Limits of torque rates [N m/s or N/s], shape (nv,); None: no limits."""
        rates = (each.torque_rate_limit(problem) for each in self.path_constraints)
        given = [limit for limit in rates if limit is not None]
        return np.min(given, axis=0) if given else None

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of the program besides the equations of motion."""
        return tuple(rows for constraint in self.path_constraints for rows in constraint.rows(problem))

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
        """Correct the offsets by a replay's misses at via points and goal.

        Args:
            problem: the original problem, with the true poses.
            replay: motion of the last solve, integrated.
            passing: times of the via points [s], shape (vias,).
        """
        missed = np.vstack([replay(passing).q.reshape(-1, problem.robot.nv), replay.q[-1]]) - problem.poses[1:]
        slower = replay.v[-1] - np.asarray(problem.v_goal)
        return replace(self, offsets=self.offsets - missed, end_velocity=self.end_velocity - slower)
