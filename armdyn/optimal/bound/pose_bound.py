"""Lower bound on the duration to a goal pose, over all joint positions that reach the pose.

Velocity limits give a time before which none of them is reached (`GoalSet.enclosed`). Momentum improves on it by
bounding the time to all goals in a box at once. A goal that velocity limits make unreachable within a time T is not
reached before T; nearer goals are enclosed by boxes, and the least of T and of these boxes' bounds holds for the whole
set.
"""

from dataclasses import replace

import numpy as np

from armdyn.arguments import StopCondition, expect
from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.bound.goal_set import GoalSet, Within, clusters
from armdyn.optimal.bound.interval import Interval
from armdyn.optimal.bound.lattice import Region
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.leg_bound import leg_bound
from armdyn.optimal.problem.problem import MinimumTimeProblem


def pose_bound(problem: MinimumTimeProblem, leg: BoundLeg, stop: StopCondition) -> tuple[float, int, float]:
    """Lower bound on the last leg's duration to any joint position that reaches the pose.

    Args:
        problem: problem with a goal pose.
        leg: last leg of the problem, to any of the goals.
        stop: stopping condition, polled regularly; once true, the bound so far is returned.

    Returns:
        The bound [s], the joint that decides it, and the bound by velocity limits alone [s]; 0: no bound, as if
        the position is free along an axis.
    """
    numbers, pose = leg.policy, expect(problem.goal_pose, GoalPose, "goal_pose")
    within = Within((leg.start.q.lower,), leg.velocity, leg.position, np.inf)
    goals = GoalSet(leg.dynamics, pose, within, numbers)
    if not goals.closed:
        return 0.0, 0, 0.0  # no closure equations with a position that is free along an axis
    nearby = (replace(leg, goal=replace(leg.goal, q=Interval.at(q))) for q in problem.goals)
    near = min(nearby, key=lambda one: one.shortest)
    kinematic = _kinematic(goals, near.shortest, stop)
    known, joint = kinematic, int(np.argmax(near.kinematic))
    if kinematic == 0 or not np.all(np.isfinite(leg.velocity)):
        return kinematic, joint, kinematic
    # The set's bound is at most that of any goal in it; that goal may be far from the fastest one.
    longest = min(leg_bound(near, stop)[0], known * numbers.most_momentum)
    for _ in range(numbers.times):
        if stop() or longest < known * (1 + numbers.near_enough):
            break
        middle = (known + longest) / 2
        bound, decides = _before(goals.before(middle), leg, (known, joint), stop)
        if bound > known:
            known, joint = bound, decides
        if bound < middle:
            longest = middle
    return known, joint, kinematic


def _kinematic(goals: GoalSet, near: float, stop: StopCondition) -> float:
    """Time before which no motion within velocity limits reaches the pose [s], given a goal's time; 0: no bound."""
    known, boxes, numbers = 0.0, goals.before(near).whole, goals.policy
    for size in numbers.sizes:
        if boxes is None or stop():
            break
        if len(boxes.lower) > numbers.few:  # too many to bisect: only those reached soon
            near = known + numbers.early * (near - known)
        boxes = goals.before(near).enclosed(boxes, size, stop)
        known = max(known, float(np.min(goals.within.times(boxes, goals.turning), initial=near)))
    return known


def _before(goals: GoalSet, leg: BoundLeg, known: tuple[float, int], stop: StopCondition) -> tuple[float, int]:
    """Bound by boxes of all goals reachable in the set's time, at most that time, and the deciding joint.

    The region with the least bound is improved first: by momentum, and then by bisection.
    """
    whole, longest = goals.whole, goals.within.duration
    if whole is None:
        return known
    enclosed = goals.enclosed(whole, leg.policy.size, stop)
    boxes = [one for each in clusters(enclosed, stop) for one, _ in goals.turned(each)]
    regions = [(known, Region(part, goals), False) for part in boxes]
    tries = 0
    while regions and tries < leg.policy.regions and not stop():
        regions.sort(key=lambda known: known[0])
        bound, least, tried = regions[0]  # tried by momentum: only smaller regions can raise its bound
        if bound[0] >= longest or (tried and len(least.boxes.lower) == 1):
            break
        if tried:
            regions[:1] = [(bound, Region(part, goals), False) for part in goals.cut(least.boxes)]
            continue
        regions[0] = (leg_bound(replace(leg, goal=least.end(leg.goal.v)), stop, bound[0]), least, True)
        tries += 1
    return min([bound for bound, _, _ in regions], default=(longest, known[1]))
