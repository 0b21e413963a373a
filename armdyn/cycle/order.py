"""Shortest path through layers of branches, and shortest order of a cycle's jobs.

Both are found exactly by dynamic programming; the order of many jobs by an integer program.
"""

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_matrix

from armdyn.arrays import Array

Lengths = Sequence[Sequence[Array]]
"""From every job (a row; the last row: from the start) to the end of another one (a column; the last column: to the end
of the cycle), by the branches at the end of either: each of shape (branches, branches) [s]; inf: there is no way."""

EXACT = 12
"""Jobs up to which the order is found by dynamic programming: 2¹² subsets; each more doubles time and memory."""
_CUTS = 60
"""Rounds in which subtour constraints are added to the integer program."""
_SECONDS = 5.0
"""Time limit of each round [s]."""


def through(first: Array, second: Array) -> Array:
    """Min-plus product of the lengths of two layers, shapes (a, b) and (b, c): shortest paths, shape (a, c)."""
    return np.asarray(np.min(first[:, :, None] + second[None], axis=1))


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
            ways = reached[:, None] + between
            came.append(np.argmin(ways, axis=0))
            reached = np.min(ways, axis=0)
        last = first if closed else int(np.argmin(reached))
        if reached[last] < best:
            best, path = float(reached[last]), [last]
            for back in reversed(came):
                path.append(int(back[path[-1]]))
            way = tuple(path[::-1])
    return best, way


def best_order(lengths: Lengths, closed: bool) -> tuple[float, tuple[int, ...]]:
    """The order of jobs that is shortest, branches of their ends chosen for it.

    After M. Held and R. M. Karp, "A dynamic programming approach to sequencing problems", J. SIAM 10(1), 1962.

    Args:
        lengths: between the jobs.
        closed: whether the last branch is the first one's.

    Returns:
        Its length [s], inf: there is none; and the jobs in order.
    """
    n = len(lengths) - 1
    sizes = [lengths[n][k].shape[1] for k in range(n)]
    ends = np.cumsum([0, *sizes])
    blocks = [slice(ends[k], ends[k + 1]) for k in range(n)]
    between = np.full((ends[-1], ends[-1]), np.inf)
    for j in range(n):
        for k in range(n):
            if j != k:
                between[blocks[j], blocks[k]] = lengths[j][k]
    home = np.vstack([lengths[k][n] for k in range(n)])
    best, order = np.inf, tuple(range(n))
    for first in range(lengths[n][0].shape[0]):
        begin = np.concatenate([lengths[n][k][first] for k in range(n)])
        reached = _reached(begin, between, blocks)
        last = home[:, first] if closed else np.min(home, axis=1)
        total = reached[-1] + last
        if np.min(total) < best:
            best, order = float(np.min(total)), _traced(reached, between, blocks, int(np.argmin(total)))
    return best, order


def _reached(begin: Array, between: Array, blocks: Sequence[slice]) -> Array:
    """Shortest lengths from the start through every subset of jobs to an end of one of them, shape (2ⁿ, ends)."""
    n = len(blocks)
    reached = np.full((1 << n, len(begin)), np.inf)
    for k, block in enumerate(blocks):
        reached[1 << k, block] = begin[block]
    for size in range(1, n):
        subsets = np.array([sum(1 << k for k in chosen) for chosen in combinations(range(n), size)])
        for k, block in enumerate(blocks):
            without = subsets[subsets & (1 << k) == 0]
            reached[without | (1 << k), block] = np.min(reached[without][:, :, None] + between[None, :, block], axis=1)
    return reached


def _traced(reached: Array, between: Array, blocks: Sequence[slice], end: int) -> tuple[int, ...]:
    """The order of the jobs on the shortest way through all of them to an end."""
    subset, order = len(reached) - 1, list[int]()
    while True:
        job = next(k for k, block in enumerate(blocks) if block.start <= end < block.stop)
        order.append(job)
        subset &= ~(1 << job)
        if not subset:
            return tuple(order[::-1])
        end = int(np.argmin(reached[subset] + between[:, end]))


def order_of_many(lengths: Array) -> tuple[float, tuple[int, ...]]:
    """A short order of many jobs, and a bound on all orders.

    An integer program in the edges (HiGHS, by scipy); subtours are cut off as they appear, after G. Dantzig,
    R. Fulkerson and S. Johnson, "Solution of a large-scale traveling-salesman problem", 1954. Where subtours are left
    when the rounds are over, they are joined in the order of their numbers.

    Args:
        lengths: from every job (the last row: from the start) to another one (the last column: to the end) [s], shape
            (jobs + 1, jobs + 1), at least 0.

    Returns:
        A lower bound on the length of every order [s], inf: there is none; and the jobs in order.
    """
    m = len(lengths)
    allowed = np.isfinite(lengths) & ~np.eye(m, dtype=bool)
    rows, columns = np.nonzero(allowed)
    if not rows.size:
        return np.inf, tuple(range(m - 1))
    count, edge = rows.size, np.arange(rows.size)
    leaves = csr_matrix((np.ones(count), (rows, edge)), shape=(m, count))
    enters = csr_matrix((np.ones(count), (columns, edge)), shape=(m, count))
    constraints = [LinearConstraint(leaves, 1, 1), LinearConstraint(enters, 1, 1)]
    bound, tours = np.inf, list[list[int]]()
    for _ in range(_CUTS):
        found = milp(
            lengths[allowed], integrality=np.ones(count), bounds=Bounds(0, 1), constraints=constraints,
            options={"time_limit": _SECONDS},
        )  # fmt: skip
        if found.x is None:
            break
        bound, chosen = float(found.mip_dual_bound), found.x > 0.5
        tours = _tours(dict(zip(rows[chosen].tolist(), columns[chosen].tolist(), strict=True)))
        if len(tours) == 1:
            break
        for tour in tours:
            inside = np.isin(rows, tour) & np.isin(columns, tour)
            constraints.append(LinearConstraint(inside.astype(float), -np.inf, len(tour) - 1))
    if not tours:
        return np.inf, tuple(range(m - 1))
    first = next(tour for tour in tours if m - 1 in tour)
    begin = first.index(m - 1)
    rest = [job for tour in tours if tour is not first for job in tour]
    return bound, (*first[begin + 1 :], *first[:begin], *rest)


def _tours(after: dict[int, int]) -> list[list[int]]:
    """Closed tours of a permutation, given by the successor of each place."""
    tours, left = [], set(after)
    while left:
        tour = [min(left)]
        while (to := after[tour[-1]]) != tour[0]:
            tour.append(to)
        left -= set(tour)
        tours.append(tour)
    return tours
