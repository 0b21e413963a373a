"""How fast no motion within the limits can be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from armdyn.brief import brief
from armdyn.optimal.bound.enclosure.interval import down
from armdyn.optimal.bound.leg import legs_of
from armdyn.optimal.bound.leg_bound import leg_bound
from armdyn.optimal.bound.pose_bound import pose_bound
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem

T = TypeVar("T")


@brief
@dataclass(frozen=True, eq=False)
class LowerBound:
    """A duration that no motion within the limits beats: proven, with all rounding outward.

    Attributes:
        duration: [s].
        joint: whose way and speed limit decide it; with via points, on the leg that takes longest.
        kinematic: what the velocity limits alone say [s].
    """

    duration: float
    joint: str
    kinematic: float

    @property
    def ramps(self) -> float:
        """What speeding up and slowing down cost at least, beyond the velocity limits [s]."""
        return self.duration - self.kinematic


def lower_bound(problem: MinimumTimeProblem, stop: Callable[[], bool] | None = None) -> LowerBound | None:
    """How fast no motion to `q_goal` can be: by momentum, over boxes nested in time.

    Limits of torque, velocity, position and acceleration count, friction, via points and velocities at the ends.
    Whatever else is asked only makes motions slower. The kinematic bound is all there is if a joint has no velocity
    limit: nothing then bounds the Coriolis forces by which it may help others. Further `goals`, other ways round or
    branches, are motions of their own with bounds of their own.

    Far from both ends the boxes are wide, and what torque can do there is hardly limited. Where the fastest ramps send
    other joints away from their goals the bound hence misses what turning these back costs: some 2 % in one of ten
    random motions of a Panda, next to nothing in the others.

    Args:
        problem: as `solve_minimum_time` takes it.
        stop: asked now and then; once it is true, what is proven so far is returned.

    Returns:
        None if no joint that moves has a velocity limit, so that this bound says nothing.

    Raises:
        ProblemError: problem is none.
        BridgeError: the dynamics have an operation that is not known in intervals.
    """
    *legs, last = legs_of(expect_problem(problem))
    stop = stop or (lambda: False)
    if problem.goal_pose is None:
        *bound, fastest = *leg_bound(last, stop), last.shortest
    else:
        *bound, fastest = pose_bound(problem, last, stop)
    kinematic = _sum_down([*(leg.shortest for leg in legs), fastest])
    if kinematic == 0:
        return None
    found = [*(leg_bound(leg, stop) for leg in legs), tuple(bound)]
    _, joint = max(found)
    return LowerBound(
        duration=max(_sum_down([duration for duration, _ in found]), kinematic),
        joint=problem.robot.joint_names[joint],
        kinematic=kinematic,
    )


def soonest(
    problem: MinimumTimeProblem, bound: Callable[[MinimumTimeProblem], T | None], seconds: Callable[[T], float]
) -> T | None:
    """The bound of that of all goals which may be reached soonest: no motion to any of them beats it.

    Args:
        problem: with one goal or several.
        bound: of the same problem with one of the goals alone, as `lower_bound`; it is asked no more than there is to
            ask, the goals that are nearest by velocity limits first.
        seconds: what a bound says [s].

    Returns:
        None: some goal that may be the soonest has none.
    """
    least: T | None = None
    alone = [problem.variant(q_goal=q, goal_pose=None, wrap=False) for q in problem.goals]
    for one in sorted(alone, key=lambda one: one.duration_bound()):
        if least is not None and one.duration_bound() >= seconds(least):
            break
        found = bound(one)
        if found is None:
            return None
        least = found if least is None else min(least, found, key=seconds)
    return least


def _sum_down(durations: list[float]) -> float:
    """Their sum [s], rounded down."""
    total = 0.0
    for duration in durations:
        total = duration if total == 0 else float(down(np.array(total + duration)))
    return total
