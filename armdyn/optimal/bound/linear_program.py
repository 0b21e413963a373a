"""Linear programs that are put together from blocks, and the marginals of their equations."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import _armdyn_enclosure as enclosure
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linprog
from scipy.sparse import csc_matrix, csr_matrix

from armdyn.arrays import Array

Entries = tuple[NDArray[np.intp], NDArray[np.intp], Array]
"""Rows, columns and values of a matrix's entries."""

_FURTHEST = 100.0
"""Bound of unknowns without one, in a program in boxes: all are scaled to be about 1."""
_MOST = 60
"""Iterations; those that end take 12 to 25."""


@dataclass(eq=False)
class LinearProgram:
    """A linear program that is put together from blocks.

    Attributes:
        bounds: of the unknowns, in parts.
        costs: likewise.
        right: right sides of the equations, in parts.
        entries: rows, columns and values of the equations' matrix, in parts.
        limits: the same of inequalities, whose right sides are zero.
    """

    bounds: list[Array] = field(default_factory=list)
    costs: list[Array] = field(default_factory=list)
    right: list[Array] = field(default_factory=list)
    entries: list[Entries] = field(default_factory=list)
    limits: list[Entries] = field(default_factory=list)

    def unknown(
        self, shape: tuple[int, int], lower: ArrayLike = -np.inf, upper: ArrayLike = np.inf, cost: float = 0.0
    ) -> NDArray[np.intp]:
        """Numbers of further unknowns between bounds."""
        first = sum(map(len, self.costs))
        bounds = [np.broadcast_to(end, shape).ravel() for end in (lower, upper)]
        self.bounds.append(np.stack(bounds, axis=-1))
        self.costs.append(np.full(shape[0] * shape[1], cost))
        return first + np.arange(shape[0] * shape[1]).reshape(shape)

    def rows(self, right: Array) -> NDArray[np.intp]:
        """Numbers of further equations with these right sides."""
        first = sum(map(np.size, self.right))
        self.right.append(right)
        return first + np.arange(right.size).reshape(right.shape)

    def diagonal(self, rows: NDArray[np.intp], unknowns: NDArray[np.intp], values: ArrayLike) -> None:
        """One entry for each row."""
        self.entries.append((rows.ravel(), unknowns.ravel(), np.broadcast_to(values, rows.shape).ravel()))

    def blocks(self, rows: NDArray[np.intp], unknowns: NDArray[np.intp], values: Array) -> None:
        """A dense block for each group of rows: values of shape (groups, rows, unknowns)."""
        shape = values.shape
        places = np.broadcast_to(rows[:, :, None], shape), np.broadcast_to(unknowns[:, None, :], shape)
        self.entries.append((places[0].ravel(), places[1].ravel(), values.ravel()))

    def limit(self, inner: NDArray[np.intp], sign: float, length: NDArray[np.intp], bound: Array) -> None:
        """Inequalities: sign * inner + bound * length is at most 0."""
        first = sum(len(part[0]) for part in self.limits) // 2
        rows = first + np.arange(inner.size)
        self.limits.append((rows, inner.ravel(), np.full(inner.size, sign)))
        self.limits.append((rows, np.broadcast_to(length, inner.shape).ravel(), bound.ravel()))

    def solved(self, feasible: float) -> Array | None:
        """The marginals of the equations; None: the solver found no solution."""
        costs, right = np.concatenate(self.costs), np.concatenate([part.ravel() for part in self.right])
        names = ("primal_feasibility_tolerance", "dual_feasibility_tolerance")
        limits = _matrix(self.limits, len(costs))
        found = linprog(
            costs,
            A_eq=_matrix(self.entries, len(costs)),
            b_eq=right,
            A_ub=limits,
            b_ub=np.zeros(limits.shape[0]),
            bounds=np.concatenate(self.bounds),
            method="highs",
            options=dict.fromkeys(names, feasible),
        )
        return np.asarray(found.eqlin.marginals) if found.status == 0 else None

    def solved_in_boxes(self, tolerance: float) -> Array | None:
        """The marginals by the interior-point method of `_enclosure/`, for a program without inequalities.

        Its time grows with the distance between rows that have an unknown in common, but for the last few rows.

        Args:
            tolerance: of the cost, relative to 1 and to its size.
        """
        bounds = np.clip(np.concatenate(self.bounds), -_FURTHEST, _FURTHEST)
        right, cost = np.concatenate(self.right, axis=None), np.concatenate(self.costs)
        return marginals_in_boxes(_matrix(self.entries, len(bounds)).tocsc(), right, cost, bounds, tolerance)


def marginals_in_boxes(matrix: csc_matrix, right: Array, cost: Array, bounds: Array, tolerance: float) -> Array | None:
    """The marginals of the equations matrix x = right, at the x within bounds of the least cost; None: not found.

    Args:
        matrix: rows that have an unknown in common are near each other, or among the last few.
        right: sides of the equations.
        cost: of each unknown.
        bounds: of each unknown, finite, shape (unknowns, 2).
        tolerance: of the cost, relative to 1 and to its size.
    """
    matrix.sort_indices()
    found, _, _, marginals = enclosure.solve(
        start=matrix.indptr,
        row=matrix.indices,
        value=matrix.data,
        right=right,
        cost=cost,
        lower=bounds[:, 0].copy(),
        upper=bounds[:, 1].copy(),
        tolerance=tolerance,
        most=_MOST,
    )
    return np.asarray(marginals) if found else None


def _matrix(entries: Sequence[Entries], columns: int) -> csr_matrix:
    rows, places, values = (np.concatenate([part[k] for part in entries]) for k in range(3))
    return csr_matrix((values, (rows, places)), shape=(int(np.max(rows)) + 1, columns))
