"""Several collision-free joint paths between two poses, by RRT-Connect (`scene/_collision/planner.hpp`, in C++)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.models.scene.collision import CollisionModel

NEAR_STRAIGHT = 1.03
"""Ratio of a path's time to the straight line's, up to which no second path is planned."""
ENOUGH = 8_000
"""Checks [1] after which one path is enough if the next attempts find none: those of four usual attempts."""


@dataclass(frozen=True)
class PlannerOptions:
    """Options of the planner; lengths are in seconds at the velocity limits.

    Attributes:
        step: distance between collision checks, in the largest component. A Panda's fastest point moves 4 cm in 0.02 s;
            the motion's verification finds collisions between checks.
        reach: length by which a tree grows towards a random point; 0.1 to 0.2 need the fewest checks in shelves.
        checks: collision checks of all attempts together, so that the work does not depend on the clock.
        first_checks: of the first attempt. Times to a path have a heavy tail: starting again beats continuing.
        growth: factor from the checks of one attempt to those of the next.
        shortcuts: random shortcuts tried on every path.
        beyond: random points are no farther than this from the box around both ends: half as many checks, and paths
            shorter by a tenth, than with points from within all bounds;
        everywhere: period of the attempts without this box.
        paths: number of paths.
    """

    step: float = 0.02
    reach: float = 0.15
    checks: int = 200_000
    first_checks: int = 1_500
    growth: float = 1.3
    shortcuts: int = 60
    beyond: float = 0.4
    everywhere: int = 3
    paths: int = 4


@dataclass(frozen=True, eq=False)
class JointSpace:
    """Configuration space of a planner.

    Attributes:
        model: checks for collisions.
        lower: joint positions [rad or m], shape (n,), finite.
        upper: likewise.
        speed: velocity limits [rad/s or m/s], shape (n,), finite: they scale the joints against each other.
        least: distances of the model's `touching` pairs above which these count as free [m], shape (m,).
    """

    model: CollisionModel
    lower: Array
    upper: Array
    speed: Array
    least: Array


def plan_paths(
    space: JointSpace,
    start: Array,
    goal: Array,
    seed: int = 0,
    options: PlannerOptions | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Iterator[Array]:
    """Plan collision-free paths lazily: each is planned when the iterator is advanced.

    Args:
        space: joint positions and the collision model.
        start: [rad or m], shape (n,), free.
        goal: likewise.
        seed: of the random points; the same seed gives the same paths.
        options: resolution and budget.
        stop: whether to give up; polled within an attempt, too.

    Yields:
        Joint positions of each path, shape (m, n); none if there was none within the options' checks.
    """
    options = PlannerOptions() if options is None else options
    frame = np.array([start, goal, space.lower, space.upper]) / space.speed
    ends = np.min(frame[:2], axis=0), np.max(frame[:2], axis=0)
    straight = float(np.max(np.abs(frame[1] - frame[0])))
    left, checks, attempt, found = options.checks, options.first_checks, 0, 0
    while found < options.paths and left > 0 and not stop():
        random, cuts = (np.random.default_rng(own) for own in ([seed, attempt], [seed, attempt, 1]))
        beyond = options.beyond if (attempt + 1) % options.everywhere else np.inf
        box = np.maximum(frame[2], ends[0] - beyond), np.minimum(frame[3], ends[1] + beyond)
        path, used = space.model.plan(
            np.vstack([frame[:2], *box, space.speed]),
            space.least,
            (random.random((min(checks, left), start.size)), cuts.random((options.shortcuts, 2))),
            (options.step, options.reach),
            (checks, left),
            stop,
        )
        left -= used
        attempt += 1
        if not path.size:
            checks = int(checks * options.growth)
            if found and options.checks - left > ENOUGH:
                break
            continue
        found += 1
        yield path * space.speed
        if length(path) < NEAR_STRAIGHT * straight:
            break


def length(path: Array) -> float:
    """Length of a path, shape (m, n), by the largest component of every segment."""
    return float(np.sum(np.max(np.abs(np.diff(path, axis=0)), axis=1)))
