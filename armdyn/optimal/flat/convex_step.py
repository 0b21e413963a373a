"""One step of sequential convexification: a quadratic program, by the interior-point method of `_curves/`, in C++."""

from dataclasses import dataclass

import _armdyn_curves as curves
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int_]

_ACCURATE = 1e-8
"""Of the quadratic program: rows are kept better than the 1e-6 to which limits are; two iterations more."""
_MOST = 60
"""Iterations; those that end take 10 to 30."""


@dataclass(frozen=True, eq=False)
class SoftRows:
    """Inequalities that may be violated at a price: `jacobian @ step - upper <= slack[group]`, with slack >= 0.

    Attributes:
        jacobian: by the free unknowns, shape (rows, unknowns).
        upper: shape (rows,).
        groups: of the slack that each row shares with others, shape (rows,).
        price: of a unit of slack.
    """

    jacobian: sp.csr_matrix
    upper: Array
    groups: Index
    price: float


@dataclass(frozen=True, eq=False)
class ConvexStep:
    """A quadratic program in the step of the free unknowns.

    The unknowns' order is that of elimination: rows that touch near ones only are cheap.

    Attributes:
        gradient: of the cost, shape (unknowns,).
        curvature: of the cost, positive semidefinite, shape (unknowns, unknowns).
        lower: bounds of the step, shape (unknowns,), below `upper`.
        upper: likewise.
        hard: inequalities without a price: their Jacobian, and upper sides of shape (rows,).
        soft: inequalities that may be violated.
        equal: equations that may be violated either way, each by a slack of its own; None: there are none.
        last: unknowns that many rows touch, as durations: they are eliminated last.
    """

    gradient: Array
    curvature: sp.csr_matrix
    lower: Array
    upper: Array
    hard: tuple[sp.csr_matrix, Array]
    soft: tuple[SoftRows, ...]
    equal: SoftRows | None = None
    last: Index | tuple[()] = ()


@dataclass(frozen=True, eq=False)
class QpSolution:
    """Solution of a `ConvexStep`.

    Attributes:
        found: whether it was solved.
        step: of the free unknowns, shape (unknowns,).
        cost: predicted change of the cost, prices of the slacks included.
        multipliers: of the hard rows and then of each of the soft ones.
        bounds: multipliers of the bounds of the step, shape (unknowns,): positive at the upper one.
    """

    found: bool
    step: Array
    cost: float
    multipliers: tuple[Array, ...]
    bounds: Array


def solve_step(problem: ConvexStep) -> QpSolution:
    """Solve a quadratic program; other threads go on meanwhile."""
    soft = [*problem.soft]
    if problem.equal is not None:
        either = problem.equal
        soft += [either, SoftRows(-either.jacobian, -either.upper, either.groups, either.price)]
    slacks, prices, before = [np.full(problem.hard[1].size, -1)], [np.empty(0)], 0
    for rows in soft:
        count = int(np.max(rows.groups, initial=-1)) + 1
        slacks.append(before + rows.groups)
        prices.append(np.full(count, rows.price))
        before += count
    jacobian = sp.vstack([problem.hard[0], *(rows.jacobian for rows in soft)], format="csr")
    n = problem.gradient.size
    order = np.append(np.delete(np.arange(n), problem.last), problem.last).astype(int)
    place = np.empty(n, dtype=np.int32)
    place[order] = np.arange(n)
    nothing = sp.csr_matrix((0, n))
    found, _, cost, *numbers = curves.solve(
        place=place,
        gradient=problem.gradient,
        curvature=_compressed(problem.curvature),
        squares=_compressed(nothing),
        square_weight=np.empty(0),
        lower=problem.lower,
        upper=problem.upper,
        rows=_compressed(jacobian),
        top=np.concatenate([problem.hard[1], *(rows.upper for rows in soft)]),
        slack=np.concatenate(slacks).astype(np.int32),
        price=np.concatenate(prices),
        tolerance=_ACCURATE,
        most=_MOST,
    )
    step, multipliers, bounds = (np.frombuffer(each) for each in numbers)
    ends = np.cumsum([problem.hard[1].size, *(rows.upper.size for rows in problem.soft)])
    each = tuple(np.split(multipliers, ends)[: 1 + len(problem.soft)])
    return QpSolution(found and bool(np.all(np.isfinite(step))), step, cost, each, bounds)


def _compressed(matrix: sp.csr_matrix) -> tuple[NDArray[np.int32], NDArray[np.int32], Array]:
    """Compressed rows, as the bridge takes them."""
    return matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32), matrix.data
