"""Several collision-free joint paths between two poses."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.planning.rrt_connect import FreeUntil, OutOfChecksError, PlannerOptions, connect, length, shortened

NEAR_STRAIGHT = 1.03
"""A path that takes no more than this times the straight line's time is not worth a second one."""
ENOUGH = 8_000
"""Checks [1] after which one path is enough if the next attempts find none: as many as four usual attempts."""

_BETWEEN_STOPS = 100
"""Checks between two questions whether to stop: some 10 ms."""


@dataclass(frozen=True, eq=False)
class JointSpace:
    """Configuration space of a planner: bounds and collision check.

    Attributes:
        free_until: how many joint positions [rad or m], shape (m, n), are free of collisions before the first that is
            not; m if all are.
        lower: joint positions [rad or m], shape (n,), finite.
        upper: likewise.
        speed: velocity limits [rad/s or m/s], shape (n,), finite: they scale the joints against each other.
    """

    free_until: FreeUntil
    lower: Array
    upper: Array
    speed: Array


class _Budget:
    """Counts collision checks, of one attempt and of all."""

    def __init__(self, space: JointSpace, checks: int, stop: Callable[[], bool]):
        self._space, self.left, self.attempt, self._stop = space, checks, 0, stop

    def free_until(self, points: Array) -> int:
        count = min(len(points), self.attempt, self.left)
        free = self._space.free_until(points[:count] * self._space.speed) if count else 0
        checks, before = min(free + 1, count), self.left
        self.attempt -= checks
        self.left -= checks
        asks = before // _BETWEEN_STOPS != self.left // _BETWEEN_STOPS
        if free == count < len(points) or (asks and self._stop()):
            raise OutOfChecksError
        return free


def plan_paths(
    space: JointSpace,
    start: Array,
    goal: Array,
    seed: int = 0,
    options: PlannerOptions | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[Array]:
    """Plan collision-free paths, one when it is asked for.

    Args:
        space: joint positions and what is free of them.
        start: [rad or m], shape (n,), free.
        goal: likewise.
        seed: of the random points; the same seed gives the same paths.
        options: how finely and how long.
        stop: whether to give up, asked within an attempt, too.

    Yields:
        Joint positions of each path, shape (m, n); none if there was none within the options' checks.
    """
    options = PlannerOptions() if options is None else options
    ends, bounds = (start / space.speed, goal / space.speed), (space.lower / space.speed, space.upper / space.speed)
    straight = float(np.max(np.abs(ends[1] - ends[0])))
    budget, checks, attempt = _Budget(space, options.checks, stop), options.first_checks, 0
    found = 0
    while found < options.paths and budget.left > 0 and not stop():
        path = _attempt(budget, checks, (ends, bounds), [seed, attempt], options)
        attempt += 1
        if path is None:
            checks = int(checks * options.growth)
            if found and options.checks - budget.left > ENOUGH:
                break
            continue
        found += 1
        yield path * space.speed
        if length(path) < NEAR_STRAIGHT * straight:
            break


def _attempt(
    budget: _Budget,
    checks: int,
    frame: tuple[tuple[Array, Array], tuple[Array, Array]],
    seed: list[int],
    options: PlannerOptions,
) -> Array | None:
    """One path, shortened as far as the attempt's checks last; None: none was found."""
    budget.attempt = checks
    try:
        path = connect(budget.free_until, *frame, seed, options)
    except OutOfChecksError:
        return None
    budget.attempt = checks
    try:
        return shortened(budget.free_until, path, [*seed, 1], options)
    except OutOfChecksError:
        return path
