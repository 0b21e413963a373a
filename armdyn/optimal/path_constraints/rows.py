"""Rows of a nonlinear program along the path: distances, accelerations, speeds, rates of torques.

They come after the equations of motion, interval by interval, and leave those as they are: a problem
without such rows has the program of `build_nlp` itself.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array, Index
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.program.assembly import Block, Nlp, build_nlp
from armdyn.optimal.program.interval import CollocationInterval, IntervalFunctions, IntervalView, differentiated
from armdyn.optimal.program.layout import Layout, Parameters
from armdyn.optimal.task.tableau import Scheme

Where = Literal["every", "first", "last", "sum"]
"""In which intervals of the motion, or of a leg; "sum": rows of all are summed, as integrals along the path are."""


@dataclass(frozen=True)
class StageRows:
    """Rows that are an expression of the stages of an interval; equal ones share a program, so they hold no numbers.

    Attributes:
        expression: (stages, numbers, *of) -> a column; a function of a module, so that equal rows are equal.
        of: what else it takes.
        numbers: how many numbers it takes.
        where: in which intervals the rows are.
        leg: in those of one leg; None: of the whole motion. Only curves have rows of one leg.
    """

    expression: Callable[..., ca.SX]
    of: tuple[Hashable, ...] = ()
    numbers: int = 0
    where: Where = "every"
    leg: int | None = None

    def functions(self, place: IntervalView) -> IntervalFunctions:
        """The rows and their derivatives."""
        return _stage_functions(replace(self, where="every", leg=None), place)  # the same wherever they are


@dataclass(frozen=True, eq=False)
class RowValues:
    """Numbers of rows and their bounds.

    Attributes:
        lower: least values, of all rows in all intervals: shape (intervals, rows), or what broadcasts to it.
        upper: greatest values, likewise.
        numbers: the parameters.
    """

    lower: ArrayLike
    upper: ArrayLike
    numbers: Array = field(default_factory=lambda: np.empty(0))


def spread(
    rows: StageRows, functions: IntervalFunctions, values: RowValues, legs: Sequence[int]
) -> tuple[Array, Array]:
    """Lower and upper bounds of rows, one for each row of the program; legs: their numbers of intervals."""
    shape = (1 if rows.where == "sum" else intervals_of(rows, legs).size, functions.defects.numel_out(0))
    return np.broadcast_to(values.lower, shape).ravel(), np.broadcast_to(values.upper, shape).ravel()


def with_rows(dynamics: Dynamics, scheme: Scheme, intervals: int, rows: Sequence[StageRows]) -> Nlp:
    """The program of `build_nlp` with rows after the equations of motion, and their numbers after its parameters.

    Args:
        dynamics: with a free last body.
        scheme: how motion becomes unknowns.
        intervals: their number.
        rows: which; those of one kind follow each other, interval by interval.
    """
    layout, view = Layout(dynamics.nv, scheme), CollocationInterval(dynamics, scheme)
    unknowns, parameters = layout.intervals(intervals), Parameters.by_interval(dynamics.nv, intervals)
    blocks, first = [], Parameters.size(dynamics.nv, intervals)
    for each in rows:
        here = intervals_of(each, (intervals,))
        numbers = (first + np.arange(each.numbers))[:, None].repeat(here.size, axis=1)
        blocks.append(
            Block(
                each.functions(view), unknowns[:, here], np.vstack([parameters[:, here], numbers]), each.where == "sum"
            )
        )
        first += each.numbers
    return build_nlp(dynamics, scheme, intervals, blocks)


def intervals_of(rows: StageRows, legs: Sequence[int]) -> Index:
    """Indices of the intervals in which rows are; legs: numbers of intervals of all legs."""
    whole = np.arange(sum(legs))
    own = whole if rows.leg is None else whole[sum(legs[: rows.leg]) : sum(legs[: rows.leg + 1])]
    return {"every": own, "sum": own, "first": own[:1], "last": own[-1:]}[rows.where]


@built_once(maxsize=64)
def _stage_functions(rows: StageRows, place: IntervalView) -> IntervalFunctions:
    one, numbers = place.stages(), ca.SX.sym("numbers", rows.numbers)
    p, name = ca.vertcat(one.p, numbers), rows.expression.__name__.strip("_")
    q, v, a = (ca.SX.sym(letter, *one.q.shape) for letter in "qva")
    column = rows.expression(replace(one, q=q, v=v, a=a), numbers, *rows.of)
    if ca.depends_on(column, one.y):
        return differentiated(name, one.y, p, rows.expression(one, numbers, *rows.of), None, place.compile)
    motion, inner = (ca.vertcat(*map(ca.vec, part)) for part in ((q, v, a), (one.q, one.v, one.a)))
    return differentiated(name, one.y, p, column, None, place.compile, (motion, inner))
