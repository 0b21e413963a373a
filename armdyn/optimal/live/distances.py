"""Distances of a live motion from obstacles and the arm itself: rows of programs, and proofs along curves."""

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
    """Clearance constraint of a live motion.

    Attributes:
        problem: problem with the obstacles.
        constraint: clearance constraint, with the places at which curves violated it.
        policy: settings of the clearance rows.
        report: report on the last checked motion.
    """

    problem: MinimumTimeProblem
    constraint: KeepsClear
    policy: SequentialPolicy
    report: ConstraintReport | None = None

    @classmethod
    def of(cls, problem: MinimumTimeProblem, policy: SequentialPolicy) -> Self | None:
        """Distances that a problem requires; None: no distances."""
        constraint = KeepsClear.from_problem(problem)
        return None if constraint is None else cls(problem, constraint, policy)

    def rows(self, curve: Curve) -> ClearanceRows:
        """Rows of a program near a curve."""
        return clearance_rows(self.constraint.required_distances(self.problem), curve, self.policy)

    def kept(self, motion: Trajectory) -> bool:
        """Whether a motion provably satisfies all distances; if not, the constraint is tightened for the next step."""
        self.report = self.constraint.check(self.problem, motion, np.empty(0))
        self.constraint = self.constraint.tightened(self.problem, self.report)
        return not self.report.reasons
