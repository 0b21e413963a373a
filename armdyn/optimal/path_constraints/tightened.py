"""What the collocation is asked for besides the equations of motion: conditions, as strict as need be, and an aim."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.models.scene.collision import Clearance
from armdyn.optimal.path_constraints.constraint import Condition, Kept, Knots
from armdyn.optimal.path_constraints.registry import conditions_of
from armdyn.optimal.path_constraints.rows import Rows, RowValues, spread
from armdyn.optimal.problem.aim import Aim
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.program.interval import Place
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Checked:
    """How a replayed motion keeps the conditions along the way.

    Attributes:
        kept: of every condition.
    """

    kept: tuple[Kept, ...]

    @property
    def reasons(self) -> tuple[str, ...]:
        """What does not hold, for people."""
        return tuple(reason for kept in self.kept for reason in kept.reasons)

    @property
    def slowing(self) -> float:
        """Factor on the duration with which the same path keeps all of them; 1 if they are kept, inf if none helps."""
        return max((kept.slowing for kept in self.kept), default=1.0)

    @property
    def worst(self) -> Violation | None:
        """What is violated most; None if all are kept."""
        found = [kept.worst for kept in self.kept if kept.worst is not None]
        return max(found, key=lambda worst: worst.value, default=None)

    @property
    def clearance(self) -> Clearance | None:
        """Where it comes nearest to touching; None if nothing was to be kept clear of."""
        found = [kept.clearance for kept in self.kept if kept.clearance is not None]
        return min(found, key=lambda clearance: clearance.distance, default=None)


@dataclass(frozen=True, eq=False)
class Demands:
    """How the collocation is to be stricter than the problem, so that the replay is as the problem asks.

    Attributes:
        conditions: as strict as they have to be.
        aim: beside via points and goal.
    """

    conditions: tuple[Condition, ...] = ()
    aim: Aim = field(default_factory=Aim)

    @classmethod
    def of(cls, problem: MinimumTimeProblem) -> Self:
        """As strict as the problem itself."""
        return cls(conditions_of(problem))

    def rows(self, problem: MinimumTimeProblem) -> tuple[Rows, ...]:
        """The rows that a program needs besides the equations of motion."""
        return tuple(rows for condition in self.conditions for rows in condition.rows(problem))

    def values(self, problem: MinimumTimeProblem, knots: Knots) -> tuple[RowValues, ...]:
        """Numbers and bounds of each of them."""
        return tuple(values for condition in self.conditions for values in condition.values(problem, knots))

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> Checked:
        """How a motion keeps them, looked at everywhere; passing: when it should be at the via points [s]."""
        return Checked(tuple(condition.check(problem, motion, passing) for condition in self.conditions))

    def stricter(self, problem: MinimumTimeProblem, checked: Checked) -> Self:
        """Each asked for more strictly, where it was not kept."""
        pairs = zip(self.conditions, checked.kept, strict=True)
        return replace(self, conditions=tuple(condition.stricter(problem, kept) for condition, kept in pairs))

    def aimed(self, problem: MinimumTimeProblem, replay: Trajectory, passing: Array) -> Self:
        """Aimed beside via points and goal by what the replay misses them by."""
        return replace(self, aim=self.aim.corrected(problem, replay, passing))

    def on_finer_mesh(self) -> Self:
        """For a mesh twice as fine, whose replay misses less."""
        return replace(self, conditions=tuple(each.on_finer_mesh() for each in self.conditions), aim=Aim())


def row_bounds(rows: Sequence[Rows], values: Sequence[RowValues], place: Place, intervals: int) -> tuple[Array, Array]:
    """Lower and upper bounds of a program's rows besides the equations of motion, in their order."""
    sides = [spread(each, each.functions(place), own, intervals) for each, own in zip(rows, values, strict=True)]
    lower, upper = zip(*sides, strict=True) if sides else ((), ())
    return np.concatenate([np.empty(0), *lower]), np.concatenate([np.empty(0), *upper])


def numbers_of(values: Sequence[RowValues]) -> Array:
    """The parameters of a program's rows."""
    return np.concatenate([np.empty(0), *(each.numbers for each in values)])
