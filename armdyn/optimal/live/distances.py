"""Distances of a live motion from obstacles and from the arm itself: asked for in programs, proven of a curve."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.optimal.flat.clearance_rows import ClearanceRows, clearance_rows
from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.path_constraints.clearance import KeepsClear
from armdyn.optimal.path_constraints.constraint import ConstraintReport
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.policy.sequential import SequentialPolicy
from armdyn.trajectory import Trajectory


@dataclass(eq=False)
class Distances:
    """Pairs of bodies that keep a clearance.

    Attributes:
        problem: its obstacles.
        constraint: with the places at which curves have missed a distance.
        policy: of clearance rows.
        report: of the last motion that was checked.
    """

    problem: MinimumTimeProblem
    constraint: KeepsClear
    policy: SequentialPolicy
    report: ConstraintReport | None = None

    @classmethod
    def of(cls, problem: MinimumTimeProblem, policy: SequentialPolicy) -> Self | None:
        """Distances that a problem asks for; None: none."""
        constraint = KeepsClear.from_problem(problem)
        return None if constraint is None else cls(problem, constraint, policy)

    def rows(self, curve: Curve) -> ClearanceRows:
        """Rows of a program near a curve."""
        return clearance_rows(self.constraint.required_distances(self.problem), curve, self.policy)

    def kept(self, motion: Trajectory) -> bool:
        """Whether a motion provably keeps all distances; if not, the constraint is tightened for the next step."""
        self.report = self.constraint.check(self.problem, motion, np.empty(0))
        self.constraint = self.constraint.tightened(self.problem, self.report)
        return not self.report.reasons
