"""One step of sequential convexification: a quadratic program, by PIQP (Schwan et al., IEEE CDC 2023)."""

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
        slack: sum of each soft rows' slacks times their price.
        multipliers: of the hard rows and then of each of the soft ones.
        bounds: multipliers of the bounds of the step, shape (unknowns,): positive at the upper one.
        iterations: of PIQP.
    """

    found: bool
    step: Array
    cost: float
    slack: Array
    multipliers: tuple[Array, ...]
    bounds: Array
    iterations: int


def solve_step(problem: ConvexStep) -> QpSolution:
    """Solve a quadratic program."""
    problem, kept = _within_reach(problem)
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
    step, slack = x[:n], np.split(prices * x[n:], np.cumsum(counts))[: len(counts)]
    cost = float(problem.gradient @ step + step @ (problem.curvature @ step) / 2 + prices @ x[n:])
    return QpSolution(
        found=status in _SOLVED and bool(np.all(np.isfinite(x))),
        step=step,
        cost=cost,
        slack=np.array([float(np.sum(part)) for part in slack]),
        multipliers=tuple(
            _all(one, which) for one, which in zip(np.split(np.array(result.z_u), ends), kept, strict=True)
        ),
        bounds=np.array(result.z_bu)[:n] - np.array(result.z_bl)[:n],
        iterations=int(result.info.iter),
    )


def _within_reach(problem: ConvexStep) -> tuple[ConvexStep, list[NDArray[np.bool_]]]:
    """The program without rows that no step within the bounds can violate, and which rows are left of each block."""
    radius = np.maximum(problem.upper, -problem.lower)
    (jacobian, top), soft = problem.hard, problem.soft
    kept = [abs(jacobian) @ radius > top, *(abs(rows.jacobian) @ radius > rows.upper for rows in soft)]
    left = tuple(
        replace(rows, jacobian=rows.jacobian[which], upper=rows.upper[which], groups=rows.groups[which])
        for rows, which in zip(soft, kept[1:], strict=True)
    )
    return replace(problem, hard=(jacobian[kept[0]], top[kept[0]]), soft=left), kept


def _all(multipliers: Array, kept: NDArray[np.bool_]) -> Array:
    """Multipliers of all rows: zero of those that were left out."""
    out = np.zeros(kept.size)
    out[kept] = multipliers
    return out


def _widened(matrix: sp.csr_matrix, columns: int) -> sp.csr_matrix:
    return sp.hstack([matrix, sp.csr_matrix((matrix.shape[0], columns))])
