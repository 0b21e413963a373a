"""The shortest way through layers of candidates, of which lengths are worked out only where they may matter."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Edge = tuple[int, int, int]
"""Layer, candidate in that layer, candidate in the next one."""


@dataclass(frozen=True, eq=False)
class Lengths:
    """Lengths of the edges between the candidates of neighbouring layers: exact, or lower bounds.

    Attributes:
        values: of every layer [s], shape (candidates, candidates of the next layer); inf: there is no way.
        exact: masks of those that are no bounds, likewise.
    """

    values: tuple[Array, ...]
    exact: tuple[NDArray[np.bool_], ...]

    def set(self, edge: Edge, value: float, exact: bool) -> None:
        """Replace one length."""
        layer, i, j = edge
        self.values[layer][i, j] = value
        self.exact[layer][i, j] = exact


def shortest(values: Sequence[Array], closed: bool) -> tuple[float, tuple[int, ...]]:
    """The shortest way through all layers, by dynamic programming.

    Args:
        values: lengths of the edges between neighbouring layers, each of shape (candidates, next candidates).
        closed: whether the way ends at the candidate of the last layer that has the number of the first one's.

    Returns:
        Its length, inf: there is none; and the number of its candidate in every layer, shape (layers,).
    """
    best, way = np.inf, tuple([0] * (len(values) + 1))
    for first in range(len(values[0])):
        reached, came = np.where(np.arange(len(values[0])) == first, 0.0, np.inf), []
        for lengths in values:
            through = reached[:, None] + lengths
            came.append(np.argmin(through, axis=0))
            reached = np.min(through, axis=0)
        last = first if closed else int(np.argmin(reached))
        if reached[last] < best:
            best, path = float(reached[last]), [last]
            for back in reversed(came):
                path.append(int(back[path[-1]]))
            way = tuple(path[::-1])
    return best, way


def edges_of(way: Sequence[int]) -> list[Edge]:
    """Edges of a way."""
    return [(layer, i, j) for layer, (i, j) in enumerate(zip(way[:-1], way[1:], strict=True))]


def shortest_exactly(
    lengths: Lengths,
    closed: bool,
    work_out: Callable[[list[Edge]], bool],
) -> tuple[float, tuple[int, ...]]:
    """The shortest way by exact lengths, of which as few as possible are worked out.

    The way that is shortest by bounds is worked out until all its edges are exact: no other way can then be shorter.

    Args:
        lengths: bounds at first.
        closed: see `shortest`.
        work_out: replaces the lengths of edges by exact ones, or by better bounds; False: it was stopped.
    """
    while True:
        length, way = shortest(lengths.values, closed)
        open_ = [edge for edge in edges_of(way) if not lengths.exact[edge[0]][edge[1:]]]
        if not np.isfinite(length) or not open_ or not work_out(open_):
            return length, way
