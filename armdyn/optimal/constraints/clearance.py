"""Clearance constraint: distances between the arm, obstacles and itself."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.models.scene.collision import CollisionModel
from armdyn.models.scene.proof_of_clearance import prove_clearance
from armdyn.optimal.constraints.constraint import ConstraintReport, PathConstraint, RequiredDistances
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.trajectory import Trajectory

_AT_ENDS = 0.98
"""Part of a pair's distance at a given pose that is proven along the motion, if that is less than the clearance."""
_LEFT = 0.7
"""Part of a pair's distance beyond the clearance at a given pose that the program requires: the motion need not begin
along a wall, and a pair at the clearance keeps it between the poses, too."""
_FAR, _FAR_OFF = 2.0, 0.02
"""Multiple of the clearance, and offset [m]: pairs farther apart at the given poses must only keep the clearance."""


@dataclass(frozen=True, eq=False)
class ClearanceConstraint(PathConstraint):
    """Pairs of bodies keep `problem.clearance`.

    Attributes:
        places: parts of each leg's duration at which distances are required, besides evenly spaced ones.
    """

    places: tuple[Array, ...] = ()

    name = "clearance"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        """Constraint of a problem with the arguments `obstacles` or `self_collision`."""
        return cls() if problem.has_clearance else None

    def required_distances(self, problem: MinimumTimeProblem) -> RequiredDistances:
        """The clearance and a margin; for a pair nearer at a given pose, (part of) its distance there."""
        model, ends = _model_and_ends(problem)
        most = np.minimum(ends, problem.clearance + _LEFT * (ends - problem.clearance))
        return RequiredDistances(model, problem.clearance, most, self._places(problem))

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check clearances by coal on the real geometry, proven between the samples."""
        model, ends = _model_and_ends(problem)
        if not model.pairs:
            return ConstraintReport(self.name, "no pair of bodies could touch")
        touching = ends - self.policy.near  # a replay is as near to the poses
        required = np.where(ends < problem.clearance, touching, np.minimum(problem.clearance, _AT_ENDS * ends))
        clearance, times = prove_clearance(model, motion, required)
        need = f"clearance is {1e3 * problem.clearance:g} mm"
        reasons = (f"{clearance}; {need}",) if times else ()
        if not (reasons or clearance.sure):
            reasons = (f"{clearance}, and it is not proven that {need} at all times",)
        short = problem.clearance - clearance.distance
        worst = Violation("clearance", clearance.body, clearance.time, short) if reasons else None
        marks = np.concatenate([motion.t[:1], passing, motion.t[-1:]])
        leg = np.clip(np.searchsorted(marks, times, side="right") - 1, 0, marks.size - 2)
        part = (np.array(times) - marks[leg]) / np.diff(marks)[leg]
        missed = np.column_stack([leg, part])
        said = str(clearance) if reasons else f"{clearance}; the clearance is proven at all times"
        return ConstraintReport(self.name, said, None, reasons, worst, missed, clearance)

    def tightened(self, problem: MinimumTimeProblem, report: ConstraintReport) -> Self:
        """Require distances also at the times at which they were violated."""
        if not report.missed.size:
            return self
        leg, part = report.missed.T
        own = enumerate(self._places(problem))
        return replace(self, places=tuple(np.append(places, part[leg == k]) for k, places in own))

    def _places(self, problem: MinimumTimeProblem) -> tuple[Array, ...]:
        return self.places or tuple(np.empty(0) for _ in problem.poses[1:])


def _model_and_ends(problem: MinimumTimeProblem) -> tuple[CollisionModel, Array]:
    """Collision model, and every pair's least distance at the given poses, capped far beyond the clearance [m]."""
    model = problem.collision_model()
    return model, np.min(model.distances(np.asarray(problem.poses), _FAR * problem.clearance + _FAR_OFF), axis=0)
