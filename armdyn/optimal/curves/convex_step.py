"""One step of sequential convexification: a quadratic program, solved by the interior-point method of `_curves/`."""

from copy import copy
from dataclasses import dataclass
from typing import Self

import _armdyn_curves as curves
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from armdyn.arrays import Array, Index
from armdyn.optimal.bound.linear_program import MOST


def with_values(pattern: sp.csr_matrix, values: Array) -> sp.csr_matrix:
    """Matrix of the same sparsity with other values; scipy's constructor would check the pattern again."""
    out = copy(pattern)
    out.data = values
    return out


@dataclass(frozen=True, eq=False)
class SoftRows:
    """Inequalities with priced violations: `jacobian @ step - upper <= slack[group]`, with slack >= 0.

    Attributes:
        jacobian: vertically stacked matrices, together of shape (rows, unknowns).
        upper: upper sides, shape (rows,); inf: no limit.
        groups: index of the slack of each row, shape (rows,).
        price: price of a unit of slack.
    """

    jacobian: tuple[sp.csr_matrix, ...]
    upper: Array
    groups: Index
    price: float

    @classmethod
    def between(cls, jacobian: sp.csr_matrix, lower: Array, upper: Array, groups: Index, price: float) -> Self:
        """Rows of `lower <= jacobian @ step <= upper`, upper sides first."""
        both = jacobian, with_values(jacobian, -jacobian.data)
        return cls(both, np.concatenate([upper, -lower]), np.tile(groups, 2), price)


@dataclass(frozen=True, eq=False)
class ConvexStep:
    """Quadratic program in a step of the unknowns.

    Attributes:
        place: place of each unknown in the order of elimination, -1: fixed, shape (unknowns,). Rows on unknowns near
            each other only, or the last ones, are cheap.
        gradient: gradient of the cost, shape (unknowns,).
        curvature: Hessian of the cost, positive semidefinite, shape (unknowns, unknowns).
        squares: rows, and the weights of their halved squares in the cost.
        bounds: bounds of the step, each of shape (unknowns,); lower below upper unless fixed.
        hard: inequalities without a price: their Jacobian and upper sides, as in `SoftRows`.
        soft: inequalities with priced violations.
    """

    place: NDArray[np.int32]
    gradient: Array
    curvature: sp.csr_matrix
    squares: tuple[sp.csr_matrix, Array]
    bounds: tuple[Array, Array]
    hard: tuple[tuple[sp.csr_matrix, ...], Array]
    soft: tuple[SoftRows, ...]


@dataclass(frozen=True, eq=False)
class QpSolution:
    """Solution of a `ConvexStep`.

    Attributes:
        found: whether the program was solved.
        step: step of the unknowns, shape (unknowns,).
        cost: predicted change of the cost, including priced slacks.
        multipliers: multipliers of the hard rows, then of the soft ones.
        bounds: multipliers of the bounds of the step, shape (unknowns,): positive at the upper one.
    """

    found: bool
    step: Array
    cost: float
    multipliers: tuple[Array, ...]
    bounds: Array


def solve_step(problem: ConvexStep, accuracy: float) -> QpSolution:
    """Solve a quadratic program; releases Python's lock.

    Args:
        problem: the program.
        accuracy: largest relative residual, and gap between the primal and the dual cost over 1 and the cost.
    """
    (hard, top), soft, before = problem.hard, problem.soft, 0
    slacks, prices = [np.full(top.size, -1)], [np.empty(0)]
    for rows in soft:
        count = int(np.max(rows.groups, initial=-1)) + 1
        slacks.append(before + rows.groups)
        prices.append(np.full(count, rows.price))
        before += count
    found, _, cost, *numbers = curves.solve(
        place=problem.place,
        gradient=problem.gradient,
        curvature=compressed(problem.curvature),
        squares=compressed(problem.squares[0]),
        square_weight=problem.squares[1],
        lower=problem.bounds[0],
        upper=problem.bounds[1],
        rows=compressed(*hard, *(part for rows in soft for part in rows.jacobian)),
        top=np.concatenate([top, *(rows.upper for rows in soft)]),
        slack=np.concatenate(slacks).astype(np.int32),
        price=np.concatenate(prices),
        tolerance=accuracy,
        most=MOST,
    )
    step, multipliers, bounds = (np.frombuffer(each) for each in numbers)
    ends = np.cumsum([top.size, *(rows.upper.size for rows in soft)])[:-1]
    each = tuple(np.split(multipliers, ends))
    return QpSolution(found and bool(np.all(np.isfinite(step))), step, cost, each, bounds)


def compressed(*matrices: sp.csr_matrix) -> tuple[NDArray[np.int32], NDArray[np.int32], Array]:
    """Compressed rows of vertically stacked matrices, for the C++ module."""
    sizes = np.concatenate([[0], *(np.diff(matrix.indptr) for matrix in matrices)])
    columns, values = zip(*((matrix.indices, matrix.data) for matrix in matrices), strict=True)
    return np.cumsum(sizes, dtype=np.int32), np.concatenate(columns, dtype=np.int32), np.concatenate(values)
