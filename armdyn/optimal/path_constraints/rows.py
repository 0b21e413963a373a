"""Rows of a nonlinear program along the path: distances, accelerations, speeds, rates of torques.

They come after the equations of motion, interval by interval, and leave those as they are: a problem
without such rows has the program of `build_nlp` itself.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.codegen.compiled import compiled
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.program.assembly import (
    Nlp,
    hessian_function,
    jacobian_function,
    scatter,
)
from armdyn.optimal.program.interval import Collocated, IntervalView, nonzeros_of
from armdyn.optimal.program.layout import Parameters

Array = NDArray[np.float64]
Where = Literal["every", "first", "last"]
"""Of a mesh's intervals."""


@dataclass(frozen=True)
class RowFunctions:
    """Rows of one interval, of (y, p, numbers), and the nonzeros of their derivatives by y.

    Attributes:
        size: how many rows an interval has.
        values: (y, p, numbers) -> rows.
        jacobian: (y, p, numbers) -> nonzeros of the rows' Jacobian.
        jacobian_pattern: where they stand.
        hessian: (y, p, numbers, λ) -> nonzeros of the upper triangle of ∂²(λᵀ rows)/∂y².
        hessian_pattern: where they stand.
    """

    size: int
    values: ca.Function
    jacobian: ca.Function
    jacobian_pattern: ca.Sparsity
    hessian: ca.Function
    hessian_pattern: ca.Sparsity


class Rows(Protocol):
    """Rows that are the same in every interval; equal ones share a program, so they hold no numbers.

    Attributes:
        numbers: how many numbers the rows take as parameters.
        where: in which intervals they are.
    """

    @property
    def numbers(self) -> int: ...  # noqa: D102

    @property
    def where(self) -> Where: ...  # noqa: D102

    def functions(self, place: IntervalView) -> RowFunctions:
        """The rows and their derivatives."""
        ...

    def __hash__(self) -> int: ...


@dataclass(frozen=True)
class StageRows:
    """Rows that are written as an expression of the stages of an interval.

    Attributes:
        expression: (stages, numbers, *of) -> a column; a function of a module, so that equal rows are equal.
        of: what else it takes.
        numbers: how many numbers it takes.
        where: in which intervals the rows are.
    """

    expression: Callable[..., ca.SX]
    of: tuple[Hashable, ...] = ()
    numbers: int = 0
    where: Where = "every"

    def functions(self, place: IntervalView) -> RowFunctions:
        """The rows and their derivatives."""
        return _stage_functions(self, place)


@dataclass(frozen=True, eq=False)
class RowValues:
    """What rows are to be.

    Attributes:
        lower: least values, of all rows in all intervals: shape (intervals, rows), or what broadcasts to it.
        upper: greatest values, likewise.
        numbers: the parameters.
    """

    lower: ArrayLike
    upper: ArrayLike
    numbers: Array = field(default_factory=lambda: np.empty(0))


def spread(rows: Rows, functions: RowFunctions, values: RowValues, intervals: int) -> tuple[Array, Array]:
    """Lower and upper bounds of rows, one for each row of the program."""
    shape = (intervals if rows.where == "every" else 1, functions.size)
    return np.broadcast_to(values.lower, shape).ravel(), np.broadcast_to(values.upper, shape).ravel()


def with_rows(nlp: Nlp, dynamics: Dynamics, rows: Sequence[Rows]) -> Nlp:
    """A program with further rows, after the equations of motion of all intervals, and their numbers as parameters.

    Args:
        nlp: of `build_nlp`.
        dynamics: the same as there.
        rows: which; those of one kind follow each other, interval by interval.
    """
    layout, N = nlp.layout, nlp.intervals
    size, unknowns = layout.size(N), layout.intervals(N)
    x, own = nlp.functions["x"], nlp.functions["p"]
    whole = ca.MX.sym("p", own.numel() + sum(each.numbers for each in rows))
    p, place = whole[: own.numel()], own.numel()
    by_interval = Parameters.by_interval(p, N)

    interval = Collocated(dynamics, layout.scheme)
    parts = [(each, each.functions(interval)) for each in rows]
    counts = [one.size * _intervals(each.where, N).size for each, one in parts]
    sigma, lam = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", N * nlp.defects + sum(counts))
    g, jacobian, hessian = [], [], ca.MX(size, size)
    first = nlp.defects * N
    for (each, one), count in zip(parts, counts, strict=True):
        here = _intervals(each.where, N)
        index = unknowns[:, here]
        numbers, place = whole[place : place + each.numbers], place + each.numbers
        arguments = (
            ca.reshape(x[index.ravel(order="F").tolist()], layout.width, here.size),
            by_interval[:, here.tolist()],
            ca.repmat(numbers, 1, here.size),
        )
        g.append(ca.vec(one.values.map(here.size)(*arguments)))
        row, col = _places(one.jacobian_pattern)
        nonzeros = one.jacobian.map(here.size)(*arguments)
        down = one.size * np.arange(here.size)
        jacobian.append(scatter(row[:, None] + down, index[col], (count, size), nonzeros))
        weights = ca.reshape(lam[first : first + count], one.size, here.size)
        row, col = _places(one.hessian_pattern)
        nonzeros = one.hessian.map(here.size)(*arguments, weights)
        hessian += scatter(index[row], index[col], (size, size), nonzeros)
        first += count

    plain_g, plain_jacobian = nlp.jacobian(x, p)
    f, plain = ca.Function("plain", [x, own], [nlp.functions["f"], nlp.functions["g"]])(x, p)
    jacobian_all = ca.vertcat(plain_jacobian, *jacobian)
    hessian_all = nlp.hessian(x, p, sigma, lam[: nlp.defects * N]) + hessian
    return replace(
        nlp,
        functions={"x": x, "p": whole, "f": f, "g": ca.vertcat(plain, *g)},
        jacobian=jacobian_function(x, whole, ca.vertcat(plain_g, *g), jacobian_all),
        gradient=ca.Function("gradient", [x, whole], [nlp.gradient(x, p)]),
        hessian=hessian_function(x, whole, sigma, lam, hessian_all),
    )


def _intervals(where: Where, count: int) -> NDArray[np.int_]:
    return {"every": np.arange(count), "first": np.array([0]), "last": np.array([count - 1])}[where]


def _places(pattern: ca.Sparsity) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    row, col = pattern.get_triplet()
    return np.array(row, dtype=int), np.array(col, dtype=int)


@built_once(maxsize=64)
def _stage_functions(rows: StageRows, place: IntervalView) -> RowFunctions:
    one = place.stages()
    numbers = ca.SX.sym("numbers", rows.numbers)
    column = rows.expression(one, numbers, *rows.of)
    given, lam, name = [one.y, one.p, numbers], ca.SX.sym("lam", column.numel()), rows.expression.__name__.strip("_")
    jacobian = ca.cse(ca.jacobian(column, one.y))
    hessian = ca.cse(ca.triu(ca.hessian(ca.dot(lam, column), one.y)[0]))
    slopes, bends = compiled(
        (
            ca.Function(f"{name}_jacobian", given, [nonzeros_of(jacobian)]),
            ca.Function(f"{name}_hessian", [*given, lam], [nonzeros_of(hessian)]),
        ),
        place.compile,
    )
    values = ca.Function(f"{name}_values", given, [column])
    return RowFunctions(column.numel(), values, slopes, jacobian.sparsity(), bends, hessian.sparsity())
