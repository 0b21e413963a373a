"""Joint positions at which an arm may rest at the stops of a cycle."""

from collections.abc import Sequence
from itertools import islice, product

import numpy as np

from armdyn.arrays import Array
from armdyn.cycle.cycle import Cycle, RestPlace, naming_step
from armdyn.errors import CycleError
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import GoalPose, free_directions, poses_reaching
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.curves.goals import slid_chain
from armdyn.optimal.problem.checks import holding_deficits
from armdyn.optimal.problem.planning_limits import Reserve, resolved_limits
from armdyn.optimal.problem.policy.search import CyclePolicy, GoalPolicy


def limits_of(cycle: Cycle) -> JointLimits:
    """Limits of the cycle's moves, before reserves."""
    given, robot = cycle.conditions, cycle.robot
    names = ("effort_limit", "velocity_limit", "position_limit", "preset")
    return resolved_limits(robot, *(given.get(name) for name in names))


def candidates(cycle: Cycle) -> tuple[tuple[Array, ...], ...]:
    """Joint positions of every stop: one per branch of the inverse kinematics.

    Raises:
        CycleError: a stop cannot be reached, or the motors cannot hold the payload there.
    """
    limits, first = limits_of(cycle), cycle.stops[0].target
    near = np.clip(np.zeros(cycle.robot.nv), limits.position_lower, limits.position_upper)
    known: list[tuple[GoalPose, tuple[Array, ...]]] = []
    found = list[tuple[Array, ...]]()
    for stop in cycle.stops:
        if cycle.closed and stop is cycle.stops[-1]:
            found.append(found[0])
            continue
        if isinstance(stop.target, GoalPose):
            positions = next((own for pose, own in known if pose == stop.target), None)
            if positions is None:
                with naming_step(stop.step, stop.name):
                    at = near if isinstance(first, GoalPose) else first
                    positions = tuple(poses_reaching(cycle.robot, stop.target, at, limits))
                known.append((stop.target, positions))
        else:
            positions = (stop.target,)
        held = _held(cycle, stop, positions, limits)
        # Whole turns of the start would give every tour again; with a free order they would be too many.
        if isinstance(stop.target, GoalPose) and stop.step and cycle.order == "given":
            held = tuple(q for branch in held for q in _turned(cycle.robot, branch, limits))
        found.append(held)
    return tuple(found)


def turns(cycle: Cycle) -> bool:
    """Whether a joint can make a whole turn within its limits, and a stop has branches."""
    limits = limits_of(cycle)
    wide = (limits.position_upper - limits.position_lower >= 2 * np.pi) & ~cycle.robot.slides
    return bool(np.any(wide)) and any(isinstance(stop.target, GoalPose) for stop in cycle.stops)


def _turned(robot: Robot, branch: Array, limits: JointLimits) -> list[Array]:
    """Joint positions with whole turns of the joints, one either way, within the limits, each of shape (nv,)."""
    turns = 2 * np.pi * ~robot.slides
    ways = [
        [q] + [q + way for way in (turn, -turn) if way and lower <= q + way <= upper]
        for q, turn, lower, upper in zip(branch, turns, limits.position_lower, limits.position_upper, strict=True)
    ]
    return [np.array(way) for way in islice(product(*ways), CyclePolicy().turned)]


def redundant(cycle: Cycle, positions: tuple[tuple[Array, ...], ...]) -> list[GoalPose | None]:
    """The goal pose of every stop that a continuum of joint positions reaches; None for the other stops."""
    targets = [stop.target for stop in cycle.stops]
    targets[-1] = targets[0] if cycle.closed else targets[-1]  # one object, as `slid_chain` wants it
    return [
        target if isinstance(target, GoalPose) and free_directions(cycle.robot, target, own[0]).size else None
        for target, own in zip(targets, positions, strict=True)
    ]


def with_slid(
    cycle: Cycle, positions: tuple[tuple[Array, ...], ...], tours: Sequence[Sequence[int]]
) -> tuple[tuple[Array, ...], ...]:
    """Branches with further ones of redundant arms, at which the velocity limits let whole tours be shorter.

    Args:
        cycle: in the order in which the steps are given.
        positions: branches of every stop.
        tours: branches of all stops, the best first.
    """
    goals = redundant(cycle, positions)
    limits, numbers, found = limits_of(cycle), GoalPolicy(), [list(own) for own in positions]
    for tour in tours[: numbers.slid]:
        chain = [own[k] for own, k in zip(positions, tour, strict=True)]
        for goal, own, q in zip(goals, found, slid_chain(cycle.robot, goals, chain, limits, numbers), strict=True):
            if goal is not None and all(np.max(np.abs(q - other)) > numbers.distinct for other in own):
                own.append(q)
    return tuple(_held(cycle, stop, tuple(own), limits) for stop, own in zip(cycle.stops, found, strict=True))


def _held(cycle: Cycle, stop: RestPlace, positions: tuple[Array, ...], limits: JointLimits) -> tuple[Array, ...]:
    """Joint positions at which the motors hold the arm with all that it carries at the stop; without torques all.

    Raises:
        CycleError: no branch can be held.
    """
    if cycle.conditions.get("kinematic"):
        return positions
    names = cycle.robot.joint_names
    kept = Reserve.of(cycle.conditions.get("reserve", 0.0), 0.0, names)
    idle, held, worst = cycle.conditions.get("passive", ()), [], None
    for q in positions:
        falls = None
        for step in range(stop.step, stop.rests[-1] + 1 if stop.rests else stop.step + 1):
            arm = cycle.arms[min(step, len(cycle.steps))]
            weak = holding_deficits(arm, limits, q, kept.effort, "pose")
            weak = [one for one in weak if one.motor and one.beyond and one.joint not in idle]
            if weak and falls is None:
                falls = step, arm, weak[0]
        if falls is None:
            held.append(q)
        elif worst is None or falls[2].excess < worst[2].excess:
            worst = falls
    if held or worst is None:
        return tuple(held)
    step, arm, joint = worst
    carried = f" with {arm.payload.name!r} of {arm.payload.mass:g} kg" if arm.payload else ""
    where = "" if len(positions) == 1 else f"; so it is in all {len(positions)} branches"
    raise CycleError(step, cycle.name_of(step), f"the arm cannot rest{carried}: {joint.words}{where}")
