"""The shortest way through layers of branches."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from armdyn.arrays import Array


def shortest(lengths: Sequence[Array], closed: bool) -> tuple[float, tuple[int, ...]]:
    """The shortest way through all layers, by dynamic programming.

    Args:
        lengths: between the branches of neighbouring layers, each of shape (branches, next branches); inf: no way.
        closed: whether the way ends at the branch of the last layer that has the number of the first one's.

    Returns:
        Its length, inf: there is none; and the number of its branch in every layer, shape (layers,).
    """
    best, way = np.inf, tuple([0] * (len(lengths) + 1))
    for first in range(len(lengths[0])):
        reached, came = np.where(np.arange(len(lengths[0])) == first, 0.0, np.inf), []
        for between in lengths:
            through = reached[:, None] + between
            came.append(np.argmin(through, axis=0))
            reached = np.min(through, axis=0)
        last = first if closed else int(np.argmin(reached))
        if reached[last] < best:
            best, path = float(reached[last]), [last]
            for back in reversed(came):
                path.append(int(back[path[-1]]))
            way = tuple(path[::-1])
    return best, way
