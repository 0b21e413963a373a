"""Base class of path constraints.

The program that is solved asks for it at the points of a mesh (`rows`, `values`), the replayed motion is looked at
everywhere (`check`), and what is missing between the points is asked for more strictly (`tightened`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from armdyn.arrays import Array
from armdyn.models.scene.collision import Clearance, CollisionModel
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.constraint_spec import PathConstraintSpec
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.task.policy.landing import PathConstraintPolicy
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class ConstraintReport:
    """Report on a motion and a path constraint, checked along the whole motion.

    Attributes:
        name: of the constraint.
        said: the same in a few words, with units.
        share: the largest value of what is limited, as a part of its limit; None if nothing is.
        reasons: what does not hold, for people; empty: the constraint is kept.
        worst: where it is violated most; None: the constraint is kept.
        missed: what `tightened` needs to know, as the constraint chooses.
        clearance: where the motion comes nearest to touching, where it is to keep clear.
        order: power of the duration by which the share falls on the same path: 1 of a speed, 2 of an acceleration, 3 of
            a jerk; 0: no slower motion keeps the constraint.
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
        """Factor on the duration with which the same path keeps the constraint; 1 if it is kept, inf if none helps."""
        if not self.reasons:
            return 1.0
        return self.share ** (1 / self.order) if self.order and self.share else np.inf


@dataclass(frozen=True, eq=False)
class Path:
    """A guess's way through joint positions, over s from 0 to 1.

    Attributes:
        q: [rad or m], shape (samples, nv).
        dq: its first derivatives by s, likewise.
        ddq: its second.
    """

    q: Array
    dq: Array
    ddq: Array


@dataclass(frozen=True, eq=False)
class RequiredDistances:
    """Distances that pairs of bodies keep.

    Attributes:
        model: of the scene.
        clearance: that every pair keeps [m].
        most: that can be asked of each pair [m], shape (pairs,); of pairs that touch at a given pose less than that.
        places: parts of every leg's duration at which they are asked for besides even ones.
    """

    model: CollisionModel
    clearance: float
    most: Array
    places: tuple[Array, ...]


@dataclass(frozen=True)
class PathConstraint(PathConstraintSpec, ABC):
    """A path constraint, perhaps tightened.

    A frozen dataclass; `tightened` returns another. All but `check` may be left as it is here.

    Attributes:
        policy: tuned numbers of path constraints.
        option: its name in `--limit NAME=…`; empty: it cannot be given there.
        metavar: what `…` stands for, with its unit in the help.
        help: one line of that help.
    """

    policy: PathConstraintPolicy = field(default=PathConstraintPolicy(), kw_only=True, repr=False, compare=False)

    option: ClassVar[str] = ""
    metavar: ClassVar[str] = "X"
    help: ClassVar[str] = ""

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        """The constraint that a problem's own keyword asks for, if it has one and that is given."""
        return None

    @classmethod
    def of_option(cls, values: list[float], frame: str | None) -> Self:
        """The constraint that `--limit NAME=VALUES[@FRAME]` asks for.

        Raises:
            ProblemError: the values are too many, or it takes no frame.
        """
        raise NotImplementedError(f"{cls.__name__} has no option")

    def under(self, policy: PathConstraintPolicy) -> Self:
        """The constraint with the tuned numbers of a policy."""
        return replace(self, policy=policy)

    def derivative_limit(self, problem: MinimumTimeProblem) -> tuple[int, Array] | None:
        """Order, 2 or 3, of a derivative of the joint positions, and its limits, shape (nv,), if it limits just that.

        Curves keep it by their control points, everywhere, without rows.
        """
        return None

    def torque_rate_limit(self, problem: MinimumTimeProblem) -> Array | None:
        """Limits of how fast torques change [N m/s or N/s], shape (nv,), if it limits just that.

        Curves keep them from each of their torques to the next, without rows.
        """
        return None

    def required_distances(self, problem: MinimumTimeProblem) -> RequiredDistances | None:
        """Distances between bodies, if it asks for just these: curves keep them without rows of the program."""
        return None

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows that the constraint adds to the program."""
        return ()

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        """Numbers and bounds of each of `rows`."""
        return ()

    def report(
        self, share: float, words: str, reason: str, worst: tuple[str, str, float], name: str = "", order: int = 1
    ) -> ConstraintReport:
        """Report on the largest value of what is limited.

        Args:
            share: it, as a part of its limit.
            words: the same in a few words, with units.
            reason: why the constraint does not hold, where it does not.
            worst: what is exceeded, joint or frame, and when [s].
            name: of the constraint; empty: its own.
            order: see `ConstraintReport`.
        """
        name = name or self.name
        if share <= 1 + self.policy.rate_tolerance:
            return ConstraintReport(name, words, share, order=order)
        return ConstraintReport(name, words, share, (reason,), Violation(*worst, share - 1), order=order)

    @abstractmethod
    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check a motion along its whole duration, independently of the collocation.

        Args:
            problem: what is asked.
            motion: a replay: its torques and states fit each other.
            passing: when it should be at the via points [s], shape (vias,).
        """

    def tightened(self, problem: MinimumTimeProblem, report: ConstraintReport) -> Self:
        """The constraint, tightened where a motion of the mesh missed it between the points."""
        return self

    def on_finer_mesh(self) -> Self:
        """The constraint for a mesh twice as fine, on which it may be less strict."""
        return self

    def least_duration(self, problem: MinimumTimeProblem, path: Path) -> float:
        """Shortest duration [s] that an initial guess along a path should have; 0: any."""
        return 0.0
