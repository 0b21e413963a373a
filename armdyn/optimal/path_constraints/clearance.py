"""The arm keeps clear of obstacles and of itself."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.models.scene.collision import CollisionModel
from armdyn.models.scene.proof_of_clearance import prove_clearance
from armdyn.optimal.path_constraints.constraint import ConstraintReport, PathConstraint, RequiredDistances
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.trajectory import Trajectory

_AT_ENDS = 0.98
"""Part of a pair's distance at a given pose that is proven along the motion, where that is less than the clearance."""
_LEFT = 0.7
"""Part of what a pair has beyond the clearance at a given pose that the program asks of it: the motion need not begin
along a wall, and where it passes just by the clearance it is kept between the poses, too."""
_FAR, _FAR_OFF = 2.0, 0.02
"""Times the clearance, and [m] beyond: pairs that are so far apart at the given poses keep the clearance alone."""
_NEARER = 1e-4
"""By so much a pair that touches at a given pose may be nearer along the way [m]: the program keeps it at poses."""


@dataclass(frozen=True, eq=False)
class KeepsClear(PathConstraint):
    """Pairs of bodies keep `problem.clearance`.

    Attributes:
        places: parts of each leg's duration at which distances are asked for besides even ones.
    """

    places: tuple[Array, ...] = ()

    name = "clearance"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        """Constraint of a problem with the keywords `obstacles` or `self_collision`."""
        return cls() if problem.crowded else None

    def required_distances(self, problem: MinimumTimeProblem) -> RequiredDistances:
        """The clearance and a little more; of a pair that is nearer at a given pose that distance, or part of it."""
        model, ends = _model_and_ends(problem)
        places = self.places or tuple(np.empty(0) for _ in problem.poses[1:])
        most = np.minimum(ends, problem.clearance + _LEFT * (ends - problem.clearance))
        return RequiredDistances(model, problem.clearance, most, places)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check clearances by coal on the real geometry, proven between the samples."""
        model, ends = _model_and_ends(problem)
        if not model.pairs:
            return ConstraintReport(self.name, "no pair of bodies could touch")
        required = np.where(ends < problem.clearance, ends - _NEARER, np.minimum(problem.clearance, _AT_ENDS * ends))
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
        return ConstraintReport(self.name, str(clearance), None, reasons, worst, missed, clearance)

    def tightened(self, problem: MinimumTimeProblem, report: ConstraintReport) -> Self:
        """Require distances also at the times at which they were violated."""
        if not report.missed.size:
            return self
        own = self.places or tuple(np.empty(0) for _ in problem.poses[1:])
        leg, part = report.missed.T
        return replace(self, places=tuple(np.append(places, part[leg == k]) for k, places in enumerate(own)))


def _model_and_ends(problem: MinimumTimeProblem) -> tuple[CollisionModel, Array]:
    """The scene, and the least distance of every pair at the given poses, or one far beyond the clearance [m]."""
    model = problem.collision_model()
    return model, np.min(model.distances(np.asarray(problem.poses), _FAR * problem.clearance + _FAR_OFF), axis=0)
