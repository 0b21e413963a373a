"""One step of sequential convexification: a quadratic program, by PIQP (Schwan et al., IEEE CDC 2023)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import piqp
import scipy.sparse as sp
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int_]

_SOLVED = (piqp.PIQP_SOLVED, piqp.PIQP_MAX_ITER_REACHED)
_ACCURATE = 1e-8
"""Of the quadratic program: rows are kept better than the 1e-6 to which limits are; two iterations more."""


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

    Attributes:
        gradient: of the cost, shape (unknowns,).
        curvature: of the cost, positive semidefinite, shape (unknowns, unknowns).
        lower: bounds of the step, shape (unknowns,), not positive.
        upper: likewise, not negative.
        hard: inequalities without a price: their Jacobian, and upper sides of shape (rows,).
        soft: inequalities that may be violated.
        equal: equations that may be violated either way, each by a slack of its own; None: there are none.
    """

    gradient: Array
    curvature: sp.csc_matrix
    lower: Array
    upper: Array
    hard: tuple[sp.csr_matrix, Array]
    soft: tuple[SoftRows, ...]
    equal: SoftRows | None = None


@dataclass(frozen=True, eq=False)
class QpSolution:
    """Solution of a `ConvexStep`.

    Attributes:
        found: whether PIQP solved it.
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


def solve_step(problem: ConvexStep, near: float) -> QpSolution:
    """Solve a quadratic program, first without rows that a step hardly meets; those that it violates are put back.

    Args:
        problem: what is to be solved.
        near: part of the farthest that a step within the bounds can change a row; with equations, rows that have more
            to spare are left out at first. Without, those only that no step within the bounds can violate.
    """
    near = near if problem.equal is not None and problem.equal.upper.size else 1.0
    farthest = np.maximum(problem.upper, -problem.lower)
    rows = [problem.hard, *((one.jacobian, one.upper) for one in problem.soft)]
    kept = [near * (abs(jacobian) @ farthest) > top for jacobian, top in rows]
    while True:
        found = _solved(problem, kept)
        changes = [np.where(own, -np.inf, jacobian @ found.step) for own, (jacobian, _) in zip(kept, rows, strict=True)]
        if not any(np.any(change > top + _ACCURATE) for change, (_, top) in zip(changes, rows, strict=True)):
            return found
        # With those it uses up half of: the next step would violate many of them.
        kept = [own | (change > top / 2) for own, change, (_, top) in zip(kept, changes, rows, strict=True)]


def _solved(problem: ConvexStep, kept: Sequence[NDArray[np.bool_]]) -> QpSolution:
    """Solution of a program without some of its hard rows, and of each of the soft ones."""
    problem = _with_rows(problem, kept)
    n, counts = problem.gradient.size, [int(np.max(rows.groups, initial=-1)) + 1 for rows in problem.soft]
    equal = problem.equal if problem.equal is not None and problem.equal.upper.size else None
    either = 0 if equal is None else equal.upper.size
    slacks = sum(counts) + 2 * either
    blocks, tops, before = [_widened(problem.hard[0], slacks)], [problem.hard[1]], 0
    for rows, count in zip(problem.soft, counts, strict=True):
        size = rows.upper.size
        share = sp.csr_matrix((-np.ones(size), (np.arange(size), before + rows.groups)), shape=(size, slacks))
        blocks.append(sp.hstack([rows.jacobian, share]))
        tops.append(rows.upper)
        before += count
    prices = np.concatenate([np.full(count, rows.price) for rows, count in zip(problem.soft, counts, strict=True)])
    if equal is not None:
        prices, one = np.append(prices, np.full(2 * either, equal.price)), sp.identity(either)
        matrix = sp.hstack([equal.jacobian, sp.csr_matrix((either, sum(counts))), -one, one], format="csc")
    solver = piqp.SparseSolver()
    solver.settings.eps_abs = solver.settings.eps_rel = _ACCURATE
    if equal is None:
        solver.settings.preconditioner_iter = 0  # rows and unknowns have scales near 1: without it a fifth less time
    else:
        # Short legs have large torque rows: without both, rounding stalls a third of the programs.
        solver.settings.preconditioner_scale_cost = True
        solver.settings.iterative_refinement_always_enabled = True
    solver.setup(
        sp.block_diag([problem.curvature, sp.csc_matrix((slacks, slacks))], format="csc"),
        np.concatenate([problem.gradient, prices]),
        None if equal is None else matrix,
        None if equal is None else equal.upper,
        sp.vstack(blocks, format="csc"),
        None,
        np.concatenate(tops),
        np.concatenate([problem.lower, np.zeros(slacks)]),
        np.concatenate([problem.upper, np.full(slacks, np.inf)]),
    )
    status, result = solver.solve(), solver.result
    x, ends = np.array(result.x), np.cumsum([block.shape[0] for block in blocks])[:-1]
    step = x[:n]
    cost = float(problem.gradient @ step + step @ (problem.curvature @ step) / 2 + prices @ x[n:])
    return QpSolution(
        found=status in _SOLVED and bool(np.all(np.isfinite(x))),
        step=step,
        cost=cost,
        multipliers=tuple(
            _all(one, which) for one, which in zip(np.split(np.array(result.z_u), ends), kept, strict=True)
        ),
        bounds=np.array(result.z_bu)[:n] - np.array(result.z_bl)[:n],
    )


def _with_rows(problem: ConvexStep, kept: Sequence[NDArray[np.bool_]]) -> ConvexStep:
    jacobian, top = problem.hard
    soft = tuple(
        replace(rows, jacobian=rows.jacobian[which], upper=rows.upper[which], groups=rows.groups[which])
        for rows, which in zip(problem.soft, kept[1:], strict=True)
    )
    return replace(problem, hard=(jacobian[kept[0]], top[kept[0]]), soft=soft)


def _all(multipliers: Array, kept: NDArray[np.bool_]) -> Array:
    """Multipliers of all rows: zero of those that were left out."""
    out = np.zeros(kept.size)
    out[kept] = multipliers
    return out


def _widened(matrix: sp.csr_matrix, columns: int) -> sp.csr_matrix:
    return sp.hstack([matrix, sp.csr_matrix((matrix.shape[0], columns))])
