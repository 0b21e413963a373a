"""Linear programs assembled from blocks, and the marginals of their equations."""

from dataclasses import dataclass, field

import _armdyn_enclosure as enclosure
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_matrix, csr_matrix

from armdyn.arrays import Array

Entries = tuple[NDArray[np.intp], NDArray[np.intp], Array]
"""Rows, columns and values of a matrix's entries."""

LARGEST = 100.0
"""Bound of unbounded unknowns: all unknowns are scaled to about 1."""
CONVERGED = 1e-6
"""Tolerance of the cost, relative to 1 and to its size: with 1e-8 bounds of durations are the same to 1e-6."""
MOST = 60
"""Iteration limit; solves that converge take 12 to 25."""


@dataclass(eq=False)
class LinearProgram:
    """Linear program assembled from blocks.

    Attributes:
        bounds: bounds of the unknowns, in parts.
        costs: costs of the unknowns, in parts.
        right: right sides of the equations, in parts.
        entries: rows, columns and values of the equations' matrix, in parts.
        places: order of elimination of the equations, in parts.
    """

    bounds: list[Array] = field(default_factory=list)
    costs: list[Array] = field(default_factory=list)
    right: list[Array] = field(default_factory=list)
    entries: list[Entries] = field(default_factory=list)
    places: list[Array] = field(default_factory=list)

    def unknown(
        self, shape: tuple[int, int], lower: ArrayLike = -np.inf, upper: ArrayLike = np.inf, cost: float = 0.0
    ) -> NDArray[np.intp]:
        """Add unknowns between bounds; returns their indices."""
        first = sum(map(len, self.costs))
        bounds = [np.broadcast_to(end, shape).ravel() for end in (lower, upper)]
        self.bounds.append(np.stack(bounds, axis=-1))
        self.costs.append(np.full(shape[0] * shape[1], cost))
        return first + np.arange(shape[0] * shape[1]).reshape(shape)

    def rows(self, right: Array, place: ArrayLike = np.inf) -> NDArray[np.intp]:
        """Add equations with given right sides; returns their indices.

        Args:
            right: right sides.
            place: order of elimination of each equation, broadcast to these. The run time grows with the distance
                between equations with a common unknown.
        """
        first = sum(map(np.size, self.right))
        self.right.append(right)
        self.places.append(np.broadcast_to(place, right.shape))
        return first + np.arange(right.size).reshape(right.shape)

    def diagonal(self, rows: NDArray[np.intp], unknowns: NDArray[np.intp], values: ArrayLike) -> None:
        """Add coefficients elementwise: one unknown per row."""
        self.entries.append((rows.ravel(), unknowns.ravel(), np.broadcast_to(values, rows.shape).ravel()))

    def blocks(self, rows: NDArray[np.intp], unknowns: NDArray[np.intp], values: Array) -> None:
        """Add a dense block for each group of rows: values of shape (groups, rows, unknowns)."""
        shape = values.shape
        places = np.broadcast_to(rows[:, :, None], shape), np.broadcast_to(unknowns[:, None, :], shape)
        self.entries.append((places[0].ravel(), places[1].ravel(), values.ravel()))

    def solved(self) -> Array | None:
        """Marginals of the equations, by the interior-point method of `_enclosure/`; None without convergence."""
        bounds = np.clip(np.concatenate(self.bounds), -LARGEST, LARGEST)
        order = np.argsort(np.concatenate(self.places, axis=None), kind="stable")
        right = np.concatenate(self.right, axis=None)[order]
        rows, unknowns, values = (np.concatenate(part) for part in zip(*self.entries, strict=True))
        matrix = csr_matrix((values, (rows, unknowns)), shape=(len(order), len(bounds)))[order].tocsc()
        found, marginals = marginals_in_boxes(matrix, right, np.concatenate(self.costs), bounds)
        return marginals[np.argsort(order)] if found else None


def marginals_in_boxes(
    matrix: csc_matrix, right: Array, cost: Array, bounds: Array, tolerance: float = CONVERGED
) -> tuple[bool, Array]:
    """Marginals of the equations matrix x = right, at the minimiser x within bounds.

    Args:
        matrix: rows with a common unknown must be near each other, or among the last few.
        right: right sides of the equations.
        cost: cost of each unknown.
        bounds: finite bounds of each unknown, shape (unknowns, 2).
        tolerance: tolerance of the cost, relative to 1 and to its size.

    Returns:
        Whether the tolerance was reached, and the marginals; else those with the best dual bound.
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
        most=MOST,
    )
    return found, np.asarray(marginals)
