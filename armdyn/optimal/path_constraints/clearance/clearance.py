"""Base of the clearance constraints: pairs of bodies that keep a distance."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.models.scene.collision import CollisionModel
from armdyn.optimal.path_constraints.clearance.pairs import Pair, PairRows, distances_at
from armdyn.optimal.path_constraints.constraint import ConstraintReport, Knots, PathConstraint
from armdyn.optimal.path_constraints.rows import Rows, RowValues
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.task.policy.landing import PathConstraintPolicy
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ClearanceConstraint(PathConstraint):
    """Pairs keep `problem.clearance`.

    Attributes:
        margins: added to the clearance of every pair [m], shape (pairs,) or one for all.
        points: of every interval, at which distances are asked for.
    """

    margins: Array | float = 0.0
    points: int = 1

    goes_round = True

    def under(self, policy: PathConstraintPolicy) -> Self:
        """The same constraint with the tuned numbers of a policy: its first margin, its first points."""
        return replace(self, policy=policy, margins=policy.margin, points=policy.points)

    @abstractmethod
    def pairs(self, problem: MinimumTimeProblem) -> tuple[Pair, ...]:
        """Capsules and what they keep clear of."""

    @abstractmethod
    def model(self, problem: MinimumTimeProblem) -> CollisionModel:
        """The real geometry of the same."""

    def _rows(self, problem: MinimumTimeProblem) -> PairRows:
        return PairRows(self.pairs(problem))

    def _scene(self, problem: MinimumTimeProblem) -> Array:
        return np.empty(0)

    def rows(self, problem: MinimumTimeProblem) -> tuple[Rows, ...]:
        """At some points of every interval."""
        one = self._rows(problem)
        return (one,) * self.points if one.pairs else ()

    def values(self, problem: MinimumTimeProblem, knots: Knots) -> tuple[RowValues, ...]:
        """The clearance and its margin at least; less near given poses that are nearer."""
        rows = self._rows(problem)
        if not rows.pairs:
            return ()
        scene, part = self._scene(problem), np.arange(self.points) / self.points
        function = distances_at(Dynamics(problem.robot, free_last_body=True), rows.pairs, rows.kinds)
        need = problem.clearance + np.broadcast_to(self.margins, (len(rows.pairs),))
        at = knots.when[:-1] + part[:, None] * np.diff(knots.when)
        low = np.broadcast_to(need, (*at.shape, need.size)).copy()
        for knot, q in zip(knots.given, problem.poses, strict=True):
            short = np.maximum(need - np.array(function(q, scene)).ravel() + 1e-6, 0)
            share = np.maximum(1 - np.abs(at - knots.when[knot]) / self.policy.ramp, 0)
            low = np.minimum(low, need - short * share[..., None])
            if knot < at.shape[1]:
                low[0, knot] = -np.inf  # this pose is given
        return tuple(RowValues(least, np.inf, np.append(s, scene)) for s, least in zip(part, low, strict=True))

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """By coal on the real geometry, in steps that miss nothing."""
        model = self.model(problem)
        if not model.pairs:
            return ConstraintReport(self.name, "nothing that could touch")
        clearance, nearest = model.along(motion)
        near = clearance.distance < problem.clearance
        reasons = (f"{clearance}; clearance is {1e3 * problem.clearance:g} mm",) if near else ()
        missed, short = problem.clearance - nearest, problem.clearance - clearance.distance
        worst = Violation("clearance", clearance.body, clearance.time, short) if near else None
        return ConstraintReport(self.name, str(clearance), None, reasons, worst, missed, clearance)

    def tightened(self, problem: MinimumTimeProblem, kept: ConstraintReport) -> Self:
        """Raise the margins of pairs that come too near; ask at more points where something is hit all the same."""
        pairs = self.pairs(problem)
        if not kept.reasons or not pairs:
            return self
        deep = kept.clearance is not None and kept.clearance.distance < -self.policy.deep
        if deep and self.points < self.policy.most_points:
            return replace(self, points=2 * self.points)
        short: dict[tuple[str, str], float] = {}
        for names, missed in zip(self.model(problem).pairs, kept.missed, strict=True):
            for key in (names, names[::-1]):
                short[key] = max(short.get(key, 0.0), float(missed))
        others = [
            problem.obstacles[pair.other].name if isinstance(pair.other, int) else pair.other_link for pair in pairs
        ]
        missing = np.array([short.get((pair.link, other), 0.0) for pair, other in zip(pairs, others, strict=True)])
        raised = np.where(missing > 0, missing + self.policy.spare, 0)
        margins = np.broadcast_to(self.margins, missing.shape) + raised
        return replace(self, margins=margins)

    def depth(self, problem: MinimumTimeProblem, q: Array) -> float:
        """The least distance [m] of the real geometry."""
        return float(np.min(self.model(problem).distances(q), initial=np.inf))


def scene_of(problem: MinimumTimeProblem) -> Array:
    """The obstacles as parameters of a program."""
    return np.array([number for obstacle in problem.obstacles for number in obstacle.numbers()])
