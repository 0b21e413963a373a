"""Lower bound on the duration of all motions within the limits, to joint positions or to a goal pose.

To a goal pose the bound holds for all joint positions that reach it. Velocity limits give a time before which none of
them is reached (`GoalSet.enclosed`). Momentum improves on it by
bounding the time to all goals in a box at once. A goal that velocity limits make unreachable within a time T is not
reached before T; nearer goals are enclosed by boxes, and the least of T and of these boxes' bounds holds for the whole
set.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arguments import StopCondition, expect, stopper
from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.bound.enclosure import ROUNDED, Interval, sum_down
from armdyn.optimal.bound.frame_sets import GoalSet, Within, clusters
from armdyn.optimal.bound.lattice import Region
from armdyn.optimal.bound.leg import BoundLeg, bound_legs
from armdyn.optimal.bound.leg_bound import leg_bound
from armdyn.optimal.problem.policy.bound import BoundPolicy
from armdyn.optimal.problem.poses import MOST_GOALS, endless
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem
from armdyn.reprs import brief


def pose_bound(problem: MinimumTimeProblem, leg: BoundLeg, stop: StopCondition) -> tuple[tuple[float, int], float]:
    """Lower bound on the last leg's duration to any joint position that reaches the pose.

    Args:
        problem: problem with a goal pose.
        leg: last leg of the problem, to any of the goals.
        stop: stopping condition, polled regularly; once true, the bound so far is returned.

    Returns:
        The bound [s] and the joint that decides it, and the bound by velocity limits alone [s]; 0: no bound, as if
        the position is free along an axis.
    """
    numbers, pose = leg.policy, expect(problem.goal_pose, GoalPose, "goal_pose")
    within = Within((leg.start.q.lower,), leg.velocity, leg.position, np.inf)
    goals = GoalSet(leg.dynamics, pose, within, numbers)
    nearby = (replace(leg, goal=replace(leg.goal, q=Interval.at(q))) for q in problem.goals)
    near = min(nearby, key=lambda one: one.shortest)
    kinematic = _kinematic(goals, near.shortest, stop)
    known = kinematic, int(np.argmax(near.alone(near.away)))
    if kinematic == 0 or not leg.has_momentum:
        return known, kinematic
    # The set's bound is at most that of any goal in it; that goal may be far from the fastest one.
    longest = min(leg_bound(near, stop)[0], kinematic * numbers.most_momentum)
    for _ in range(numbers.passes // 4):
        if stop() or longest < known[0] * (1 + numbers.near_enough):
            break
        middle = (known[0] + longest) / 2
        found = _before(goals.before(middle), leg, known, stop)
        known = max(known, found, key=lambda bound: bound[0])
        if found[0] < middle:
            longest = middle
    return known, kinematic


def _kinematic(goals: GoalSet, near: float, stop: StopCondition) -> float:
    """Time before which no motion within velocity limits reaches the pose [s], given a goal's time; 0: no bound."""
    known, boxes, numbers = 0.0, goals.before(near).whole, goals.policy
    for size in numbers.sizes:
        if boxes is None or stop():
            break
        if len(boxes.lower) >= numbers.few:  # too many to bisect: only those reached soon
            near = known + numbers.early * (near - known)
        boxes = goals.before(near).enclosed(boxes, size, stop)
        known = max(known, float(np.min(goals.within.times(boxes, goals.turning), initial=near)))
    return known


def _before(goals: GoalSet, leg: BoundLeg, known: tuple[float, int], stop: StopCondition) -> tuple[float, int]:
    """Bound by boxes of all goals reachable in the set's time, at most that time, and the deciding joint.

    The region with the least bound is improved first: by momentum, and then by bisection. Goals outside the regions
    take that time, however long those inside take.
    """
    whole, longest = goals.whole, goals.within.duration
    if whole is None:
        return known
    enclosed = goals.enclosed(whole, 2 * leg.policy.sizes[1], stop)
    boxes = [one for each in clusters(enclosed, stop) for one, _ in goals.turned(each)]
    regions = [(known, Region(part, goals), False) for part in boxes]
    tries = 0
    while regions and tries < leg.policy.passes // 2 and not stop():
        regions.sort(key=lambda known: known[0])
        bound, least, tried = regions[0]  # tried by momentum: only smaller regions can raise its bound
        if bound[0] >= longest or (tried and len(least.boxes.lower) == 1):
            break
        if tried:
            regions[:1] = [(bound, Region(part, goals), False) for part in goals.cut(least.boxes)]
            continue
        regions[0] = (leg_bound(replace(leg, goal=least.end(leg.goal.v)), stop, bound[0]), least, True)
        tries += 1
    return min([(longest, known[1]), *(bound for bound, _, _ in regions)])


@brief
@dataclass(frozen=True, eq=False)
class LowerBound:
    """Lower bound on the duration, proven by interval arithmetic.

    Attributes:
        duration: lower bound [s].
        joint: deciding joint, by its way and speed limit; with via points, on the longest leg.
        kinematic: bound by the velocity limits alone [s].
    """

    duration: float
    joint: str
    kinematic: float

    @property
    def ramps(self) -> float:
        """Part of the bound that acceleration and deceleration add to the velocity limits [s]."""
        return self.duration - self.kinematic


def least_duration(
    problem: MinimumTimeProblem, stop: Callable[[], bool] | None = None, policy: BoundPolicy | None = None
) -> float | None:
    """Duration of `lower_bound` [s]; None: unknown."""
    bound = lower_bound(problem, stop, policy)
    return None if bound is None else bound.duration


def lower_bound(
    problem: MinimumTimeProblem, stop: Callable[[], bool] | None = None, policy: BoundPolicy | None = None
) -> LowerBound | None:
    """Prove a lower bound on the duration by the momentum equation, over boxes nested in time.

    The proof uses limits of torque, torque-speed curves, limits of velocity, position, acceleration, jerk and torque
    rate, friction, via points and velocities at the ends. All other constraints only make motions slower. Only the
    kinematic bound is available if a joint has no velocity limit: nothing then bounds its Coriolis forces on other
    joints. With `goal_pose` the bound holds for the whole set of joint positions within the limits that reach the pose,
    with `wrap` for all ways round, not only for the sampled `goals`.

    Far from both ends the boxes are wide, and torque limits have little effect on the bound. If the fastest ramps move
    other joints away from their goals, the bound therefore misses the time for their return: some 2 % in one of ten
    random motions of a Panda, almost nothing in the others. Beyond 32 joints momentum is left out: its work grows with
    the fifth power of their number, and a humanoid's gains 0.05 %.

    Args:
        problem: the minimum-time problem.
        stop: stopping condition, polled regularly, of 30 joints every few seconds; once true, the bound so far is
            returned.
        policy: tuned numbers; None: the defaults. The bound is valid for any.

    Returns:
        None if no moving joint has a velocity limit, so that there is no bound.

    Raises:
        ProblemError: problem is no problem, or stop no function.
        BridgeError: the dynamics have an operation without an interval extension.
    """
    stopped, numbers = stopper(stop), BoundPolicy() if policy is None else expect(policy, BoundPolicy, "policy")
    if expect_problem(problem).kinematic:
        problem = problem.without_torques()
    if problem.goal_pose is None and len(problem.goals) > 1:
        return _least_over_turns(problem, stopped, numbers)
    *legs, last = bound_legs(problem, numbers)
    if problem.goal_pose is None:
        slowest, fastest = leg_bound(last, stopped), last.shortest
    else:
        slowest, fastest = pose_bound(problem, last, stopped)
    kinematic = sum_down([*(leg.shortest for leg in legs), fastest])
    if kinematic == 0:
        return None
    found = [*(leg_bound(leg, stopped) for leg in legs), slowest]
    _, joint = max(found)
    return LowerBound(
        duration=max(sum_down([duration for duration, _ in found]), kinematic),
        joint=problem.robot.joint_names[joint],
        kinematic=kinematic,
    )


def _least_over_turns(problem: MinimumTimeProblem, stop: Callable[[], bool], numbers: BoundPolicy) -> LowerBound | None:
    """The least bound of all ways round, in the order of their kinematic bounds; None: one has no bound."""
    least: LowerBound | None = None
    alone = [problem.variant(q_goal=q, wrap=False) for q in problem.goals]
    for one in sorted(alone, key=lambda one: one.duration_bound()):
        if least is not None and one.duration_bound() >= least.duration:
            break
        found = lower_bound(one, stop, numbers)
        if found is None:
            return None
        least = found if least is None else min(least, found, key=lambda bound: bound.duration)
    untried = _other_turns(problem)
    if least is None or untried >= least.duration:
        return least
    return replace(least, duration=untried, kinematic=min(least.kinematic, untried)) if untried > 0 else None


def _other_turns(problem: MinimumTimeProblem) -> float:
    """Least time by velocity limits to any turn of the goal that is not among a problem's goals [s], rounded down.

    Each joint's listed goals are a turn apart. A goal that is not listed has some joint a turn further away, or is one
    of those dropped by `goals_with_turns` after the last of its list.
    """
    goals, fixed, speed = np.array(problem.goals), problem.fixed_poses, problem.limits.velocity
    begin, first, last = fixed[-2], goals.min(axis=0) - 2 * np.pi, goals.max(axis=0) + 2 * np.pi
    beyond = np.maximum(np.minimum(begin - first, last - begin), 0.0) / speed
    turning = endless(problem.robot, problem.limits)
    least = float(np.min(beyond, where=turning, initial=np.inf))
    if 2 ** int(np.sum(turning)) > MOST_GOALS:
        least = min(least, float(np.max(np.abs(goals[-1] - begin) / speed)) if len(fixed) == 2 else 0.0)
    before = np.max(np.abs(np.diff(fixed[:-1], axis=0)) / speed, axis=1)
    return (least + float(np.sum(before))) * (1 - ROUNDED)
