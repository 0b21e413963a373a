"""Rows of a nonlinear program along the path, written at the stages of one interval in symbols, and their derivatives.

Rows follow the equations of motion, interval by interval, and leave these unchanged: a problem without such rows
has the program of `build_nlp`.
"""

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array, Index
from armdyn.codegen.compiled import compiled
from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ProblemError
from armdyn.locks import built_once

Where = Literal["every", "first", "last", "sum"]
"""Intervals with rows, of the motion or of a leg; "sum": rows are summed over all intervals, for integrals."""


@dataclass(frozen=True, eq=False)
class Stages:
    """One interval in SI units, one column per stage, both knots included, for path constraints.

    Attributes:
        y: unknowns of the interval.
        p: parameters of the interval.
        h: duration of the interval [s].
        c: nodes of the stages in the interval.
        q: joint positions [rad or m], shape (nv, stages).
        v: velocities [rad/s or m/s], likewise.
        a: accelerations [rad/s² or m/s²], likewise.
        tau: torques [N m or N], likewise.
        acceleration: scale of accelerations [rad/s² or m/s²].
        effort: scales of torques [N m or N], shape (nv,).
        dynamics: dynamics of the robot.
    """

    y: ca.SX
    p: ca.SX
    h: ca.SX
    c: Array
    q: ca.SX
    v: ca.SX
    a: ca.SX
    tau: ca.SX
    acceleration: ca.SX
    effort: ca.SX
    dynamics: Dynamics


class IntervalView(Protocol):
    """An interval of a program for path constraints; equal ones share their functions.

    Attributes:
        compile: whether its derivatives become machine code, see `compiled`.
    """

    @property
    def compile(self) -> bool | None: ...

    def stages(self) -> Stages:
        """The interval's stages in symbols."""
        ...

    def __hash__(self) -> int: ...


@dataclass(frozen=True)
class IntervalFunctions:
    """Equations of one interval and the nonzeros of their derivatives; cost is None without a cost."""

    defects: ca.Function
    cost: ca.Function | None
    jacobian: ca.Function
    jacobian_pattern: ca.Sparsity
    hessian: ca.Function
    hessian_pattern: ca.Sparsity


def differentiated(
    name: str,
    y: ca.SX,
    p: ca.SX,
    defects: ca.SX,
    cost: ca.SX | None,
    compile_mode: bool | None,
    through: tuple[ca.SX, ca.SX] | None = None,
) -> IntervalFunctions:
    """An interval's equations as functions, with their derivatives.

    Args:
        name: prefix of the functions' names.
        y: unknowns of the interval.
        p: parameters of the interval.
        defects: equations of the interval.
        cost: the interval's part of the cost; None: no cost, and common subexpressions of the derivatives are computed
            once.
        compile_mode: mode for `compiled`.
        through: intermediate symbols, on which the equations depend instead of the unknowns, and their expressions;
            only without a cost. Fewer than the unknowns, they make much smaller derivatives.
    """
    sigma, lam = ca.SX.sym("sigma"), ca.SX.sym("lam", defects.numel())
    if through is not None:
        jacobian, hessian, defects = _chained(defects, lam, y, *through)
    else:
        jacobian, shared = ca.jacobian(defects, y), ca.dot(lam, defects)
        hessian = ca.hessian(shared if cost is None else sigma * cost + shared, y)[0]
    hessian = ca.triu(hessian)
    if cost is None and through is None:
        jacobian, hessian = ca.cse(jacobian), ca.cse(hessian)
    derivatives = (
        ca.Function(f"{name}_jacobian", [y, p], [nonzeros_of(jacobian)]),
        ca.Function(f"{name}_hessian", [y, p, sigma, lam], [nonzeros_of(hessian)]),
    )
    fast = compiled(derivatives, compile_mode)
    return IntervalFunctions(
        defects=ca.Function(f"{name}_defects", [y, p], [defects]),
        # The cost separately: its gradient needs no dynamics.
        cost=None if cost is None else ca.Function(f"{name}_cost", [y, p], [cost]),
        jacobian=fast[0],
        jacobian_pattern=jacobian.sparsity(),
        hessian=fast[1],
        hessian_pattern=hessian.sparsity(),
    )


def _chained(equations: ca.SX, lam: ca.SX, y: ca.SX, x: ca.SX, inner: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Jacobian and Hessian of equations in x = inner(y) by the chain rule, and the equations in y."""
    used = sorted(set(ca.jacobian_sparsity(equations, x).get_col()))
    x, inner = x[used], inner[used]
    jacobian, (hessian, gradient) = ca.jacobian(equations, x), ca.hessian(ca.dot(lam, equations), x)
    jacobian, hessian, gradient, equations = ca.substitute(
        ca.cse([jacobian, hessian, gradient, equations]), [x], [inner]
    )
    inner_jacobian, weights = ca.jacobian(inner, y), ca.SX.sym("weights", len(used))
    inner_hessian = ca.substitute(ca.hessian(ca.dot(weights, inner), y)[0], weights, gradient)
    return jacobian @ inner_jacobian, inner_jacobian.T @ hessian @ inner_jacobian + inner_hessian, equations


def nonzeros_of(matrix: ca.SX) -> ca.SX:
    """Nonzeros of a matrix as a dense column."""
    column = ca.SX(ca.Sparsity.dense(matrix.nnz(), 1), 0)
    column.nz[:] = matrix.nz[:]
    return column


@dataclass(frozen=True)
class StageRows:
    """Rows between bounds, as an expression of an interval's stages.

    Rows that differ only in their bounds and numbers are equal, and share a program.

    Attributes:
        expression: (stages, numbers, *arguments) -> a column; a module-level function: equal rows compare equal.
        lower: lower bounds of all rows in all intervals, broadcast to shape (intervals, rows).
        upper: upper bounds, likewise.
        numbers: parameters of the expression.
        arguments: further arguments of the expression.
        where: intervals with rows.
        leg: index of the leg; None: the whole motion. Only curves have rows of one leg.
        size: number of parameters.
    """

    expression: Callable[..., ca.SX]
    lower: ArrayLike = field(compare=False)
    upper: ArrayLike = field(compare=False)
    numbers: ArrayLike = field(default=(), compare=False)
    arguments: tuple[Hashable, ...] = ()
    where: Where = "every"
    leg: int | None = None
    size: int = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "size", np.size(self.numbers))

    def functions(self, place: IntervalView) -> IntervalFunctions:
        """The rows and their derivatives."""
        return _stage_functions(replace(self, where="every", leg=None), place)  # independent of the interval

    def intervals(self, legs: Sequence[int]) -> Index:
        """Indices of the intervals with rows; legs: number of intervals of each leg."""
        whole = np.arange(sum(legs))
        own = whole if self.leg is None else whole[sum(legs[: self.leg]) : sum(legs[: self.leg + 1])]
        return {"every": own, "sum": own, "first": own[:1], "last": own[-1:]}[self.where]

    def bounds(self, place: IntervalView, legs: Sequence[int]) -> tuple[Array, Array]:
        """Lower and upper bounds, one for each row of the program; legs: number of intervals of each leg."""
        places = 1 if self.where == "sum" else self.intervals(legs).size
        shape = (places, self.functions(place).defects.numel_out(0))
        return np.broadcast_to(self.lower, shape).ravel(), np.broadcast_to(self.upper, shape).ravel()


def row_bounds(rows: Sequence[StageRows], place: IntervalView, intervals: int) -> tuple[Array, Array]:
    """Lower and upper bounds of a program's rows besides the equations of motion, in their order."""
    sides = [(np.empty(0),) * 2, *(each.bounds(place, (intervals,)) for each in rows)]
    lower, upper = zip(*sides, strict=True)
    return np.concatenate(lower), np.concatenate(upper)


def numbers_of(rows: Sequence[StageRows]) -> Array:
    """Parameters of a program's rows."""
    return np.concatenate([np.empty(0), *(each.numbers for each in rows)])


@built_once(maxsize=64)
def _stage_functions(rows: StageRows, place: IntervalView) -> IntervalFunctions:
    one, numbers = place.stages(), ca.SX.sym("numbers", rows.size)
    p, name = ca.vertcat(one.p, numbers), rows.expression.__name__.strip("_")
    q, v, a = (ca.SX.sym(letter, *one.q.shape) for letter in "qva")
    column = rows.expression(replace(one, q=q, v=v, a=a), numbers, *rows.arguments)
    if not column.is_column():
        raise ProblemError(f"rows of {rows.expression.__name__} have shape {column.shape}; they must be one column")
    if ca.depends_on(column, one.y):
        return differentiated(name, one.y, p, rows.expression(one, numbers, *rows.arguments), None, place.compile)
    motion, inner = (ca.vertcat(*map(ca.vec, part)) for part in ((q, v, a), (one.q, one.v, one.a)))
    return differentiated(name, one.y, p, column, None, place.compile, (motion, inner))
