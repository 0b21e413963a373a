"""RRT-Connect: one collision-free path between two points (Kuffner, LaValle, ICRA 2000).

OMPL has this planner, too; its random numbers are seeded once for a process, so that a second call with the same seed
returns another path, and answers would depend on the calls before.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array

FreeUntil = Callable[[Array], int]
"""How many points, shape (m, n), are free of collisions before the first that is not; m if all are."""


@dataclass(frozen=True)
class PlannerOptions:
    """Options of the planner; lengths are in its coordinates, seconds at the velocity limits.

    Attributes:
        step: distance between collision checks, in the largest component. A Panda's fastest point moves 4 cm in 0.02 s;
            what slips through is found when the motion is verified.
        reach: length by which a tree grows towards a random point; 0.1 to 0.2 need the fewest checks in shelves.
        checks: collision checks of all attempts together, so that the work does not depend on the clock.
        first_checks: of the first attempt. Times to a path have a heavy tail: starting again beats going on.
        growth: factor from the checks of one attempt to those of the next.
        shortcuts: random shortcuts tried on every path.
        paths: that are looked for.
    """

    step: float = 0.02
    reach: float = 0.15
    checks: int = 200_000
    first_checks: int = 1_500
    growth: float = 1.3
    shortcuts: int = 60
    paths: int = 4


class OutOfChecksError(Exception):
    """The budget of collision checks is used up."""


class Tree:
    """Points, each with the one that it was reached from."""

    def __init__(self, root: Array):
        self._points, self._parents = np.array([root] * 64), [-1]

    def add(self, point: Array, parent: int) -> int:
        """Add a point; its index."""
        count = len(self._parents)
        if count == len(self._points):
            self._points = np.concatenate([self._points, self._points])
        self._points[count] = point
        self._parents.append(parent)
        return count

    def nearest(self, point: Array) -> int:
        """Index of the nearest point in the Euclidean norm."""
        apart = self._points[: len(self._parents)] - point
        return int(np.argmin(np.einsum("ij,ij->i", apart, apart)))

    def __getitem__(self, index: int) -> Array:
        point: Array = self._points[index].copy()
        return point

    def path(self, index: int) -> list[Array]:
        """Points from this one to the root."""
        out = []
        while index >= 0:
            out.append(self[index])
            index = self._parents[index]
        return out


def segment_is_free(free_until: FreeUntil, a: Array, b: Array, step: float) -> bool:
    """Whether points between a and b are free, checked coarsely first."""
    count = int(np.ceil(np.max(np.abs(b - a)) / step))
    inner = np.arange(1, count)
    coarse_first = inner[np.argsort(-(inner & -inner), kind="stable")]
    return free_until(a + (b - a) * coarse_first[:, None] / count) == inner.size


def connect(
    free_until: FreeUntil,
    ends: tuple[Array, Array],
    bounds: tuple[Array, Array],
    seed: list[int],
    options: PlannerOptions,
) -> Array:
    """Find a collision-free path between two points.

    Args:
        free_until: see `FreeUntil`; raises `OutOfChecksError` to end the search.
        ends: start and goal, each of shape (n,).
        bounds: lower and upper, each of shape (n,).
        seed: of the random points.
        options: step and reach.

    Returns:
        Points of the path, shape (m, n), from start to goal.

    Raises:
        OutOfChecksError: no path was found within the budget.
    """
    if segment_is_free(free_until, *ends, options.step):
        return np.array(ends)
    random, (lower, upper) = np.random.default_rng(seed), bounds
    size = upper - lower
    growing, other, swapped = Tree(ends[0]), Tree(ends[1]), False
    while True:
        added, _ = _extend(growing, lower + size * random.random(lower.size), free_until, options, far=False)
        if added is not None:
            met, hit = _extend(other, growing[added], free_until, options, far=True)
            if hit and met is not None:
                path = growing.path(added)[::-1] + other.path(met)[1:]
                return np.array(path[::-1] if swapped else path)
        growing, other, swapped = other, growing, not swapped


def _extend(
    tree: Tree, target: Array, free_until: FreeUntil, options: PlannerOptions, far: bool
) -> tuple[int | None, bool]:
    """Grow a tree towards a point as far as it is free, by at most `reach` unless `far`.

    Returns:
        Index of the last point added (None: none) and whether it is the target.
    """
    index = tree.nearest(target)
    root, way = tree[index], target - tree[index]
    length = math.sqrt(way @ way)
    if length == 0:
        return index, True
    part = 1.0 if far else min(1.0, options.reach / length)
    count = max(math.ceil(part * max(map(abs, way.tolist())) / options.step), 1)  # numpy is slow on seven numbers
    between = max(int(options.reach / (part * length / count)), 1)
    points = root + way * (part * np.arange(1, count + 1) / count)[:, None]
    free = free_until(points)
    for k in range(between, min(free + 1, count), between):
        index = tree.add(points[k - 1], index)
    if free == count:
        return tree.add(points[-1], index), part == 1.0
    return (tree.add(points[free - 1], index) if free else None), False


def length(path: Array) -> float:
    """Length of a path, shape (m, n), by the largest component of every segment."""
    return float(np.sum(np.max(np.abs(np.diff(path, axis=0)), axis=1)))


def shortened(free_until: FreeUntil, path: Array, seed: list[int], options: PlannerOptions) -> Array:
    """Replace parts of a path between random points by straight segments where these are free and shorter."""
    random = np.random.default_rng(seed)
    for _ in range(options.shortcuts):
        lengths = np.max(np.abs(np.diff(path, axis=0)), axis=1)
        marks = np.append(0.0, np.cumsum(lengths))
        cuts = np.sort(random.uniform(0, marks[-1], 2))
        i, j = (int(k) for k in np.clip(np.searchsorted(marks, cuts, side="right") - 1, 0, len(lengths) - 1))
        a, b = (
            path[k] + (path[k + 1] - path[k]) * (cut - marks[k]) / max(lengths[k], 1e-12)
            for k, cut in ((i, cuts[0]), (j, cuts[1]))
        )
        # 1e-3: a shortcut that saves less is not worth its checks.
        if i == j or np.max(np.abs(b - a)) >= (1 - 1e-3) * (cuts[1] - cuts[0]):
            continue
        if segment_is_free(free_until, a, b, options.step):
            path = np.concatenate([path[: i + 1], [a, b], path[j + 1 :]])
    return path
