"""Rows of a nonlinear program along the path: distances, accelerations, speeds, torque rates.

Rows follow the equations of motion, interval by interval, and leave these unchanged: a problem without such rows
has the program of `build_nlp`.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array, Index
from armdyn.errors import ProblemError
from armdyn.locks import built_once
from armdyn.optimal.constraints.stages import IntervalFunctions, IntervalView, differentiated

Where = Literal["every", "first", "last", "sum"]
"""Intervals with rows, of the motion or of a leg; "sum": rows are summed over all intervals, for integrals."""


@dataclass(frozen=True)
class StageRows:
    """Rows as an expression of an interval's stages; without numbers, so that equal rows share a program.

    Attributes:
        expression: (stages, numbers, *arguments) -> a column; a module-level function: equal rows compare equal.
        arguments: further arguments of the expression.
        numbers: number of parameters of the expression.
        where: intervals with rows.
        leg: index of the leg; None: the whole motion. Only curves have rows of one leg.
    """

    expression: Callable[..., ca.SX]
    arguments: tuple[Hashable, ...] = ()
    numbers: int = 0
    where: Where = "every"
    leg: int | None = None

    def functions(self, place: IntervalView) -> IntervalFunctions:
        """The rows and their derivatives."""
        return _stage_functions(replace(self, where="every", leg=None), place)  # independent of the interval


@dataclass(frozen=True, eq=False)
class RowValues:
    """Parameters and bounds of rows.

    Attributes:
        lower: lower bounds of all rows in all intervals, broadcast to shape (intervals, rows).
        upper: upper bounds, likewise.
        numbers: parameters of the expression.
    """

    lower: ArrayLike
    upper: ArrayLike
    numbers: Array = field(default_factory=lambda: np.empty(0))


def spread(
    rows: StageRows, functions: IntervalFunctions, values: RowValues, legs: Sequence[int]
) -> tuple[Array, Array]:
    """Lower and upper bounds of rows, one for each row of the program; legs: number of intervals of each leg."""
    shape = (1 if rows.where == "sum" else intervals_of(rows, legs).size, functions.defects.numel_out(0))
    return np.broadcast_to(values.lower, shape).ravel(), np.broadcast_to(values.upper, shape).ravel()


def intervals_of(rows: StageRows, legs: Sequence[int]) -> Index:
    """Indices of the intervals with rows; legs: number of intervals of each leg."""
    whole = np.arange(sum(legs))
    own = whole if rows.leg is None else whole[sum(legs[: rows.leg]) : sum(legs[: rows.leg + 1])]
    return {"every": own, "sum": own, "first": own[:1], "last": own[-1:]}[rows.where]


@built_once(maxsize=64)
def _stage_functions(rows: StageRows, place: IntervalView) -> IntervalFunctions:
    one, numbers = place.stages(), ca.SX.sym("numbers", rows.numbers)
    p, name = ca.vertcat(one.p, numbers), rows.expression.__name__.strip("_")
    q, v, a = (ca.SX.sym(letter, *one.q.shape) for letter in "qva")
    column = rows.expression(replace(one, q=q, v=v, a=a), numbers, *rows.arguments)
    if not column.is_column():
        raise ProblemError(f"rows of {rows.expression.__name__} have shape {column.shape}; they must be one column")
    if ca.depends_on(column, one.y):
        return differentiated(name, one.y, p, rows.expression(one, numbers, *rows.arguments), None, place.compile)
    motion, inner = (ca.vertcat(*map(ca.vec, part)) for part in ((q, v, a), (one.q, one.v, one.a)))
    return differentiated(name, one.y, p, column, None, place.compile, (motion, inner))
