"""From a leg of a cycle and joint positions at its ends to a minimum-time problem."""

from collections.abc import Sequence
from itertools import islice, product
from typing import Any

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.cycle.cycle import Cycle, Leg, naming_step
from armdyn.cycle.steps import Straight
from armdyn.cycle.stops import limits_of
from armdyn.errors import CycleError, ProblemError
from armdyn.models.robots.poses import pose_given
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import REACHED, GoalPose, deviations_of, frame_placement
from armdyn.optimal.constraints.rate_limits import FrameSpeedLimit
from armdyn.optimal.constraints.regions import FrameRegion
from armdyn.optimal.problem.policy.search import CyclePolicy
from armdyn.optimal.problem.poses import check_via_regions, via_positions
from armdyn.optimal.problem.problem import MinimumTimeProblem


def problem_of(cycle: Cycle, leg: Leg, q_start: Array, q_goal: Array) -> MinimumTimeProblem:
    """The problem of a leg between joint positions.

    A straight segment is a leg of the same motion: its other end is passed in flight, in a region as wide as the line's
    tolerances, and between both ends the frame stays on the line.

    Args:
        cycle: of which it is a leg.
        leg: the motion.
        q_start: joint positions at its beginning [rad or m], shape (nv,).
        q_goal: likewise at its end.

    Raises:
        CycleError: the problem is ill-posed, with the step's number and name.
    """
    move, robot = leg.move, leg.robot
    via: list[Any] = list(move.via)
    lines = list[FrameRegion]()
    if isinstance(move.retreat, Straight):
        passed, line = _on_line(robot, move.retreat, move.to, q_start)
        via.insert(0, passed)
        lines.append(FrameRegion(line, leg=0))
    if isinstance(move.approach, Straight):
        passed, line = _on_line(robot, move.approach, move.to, q_goal)
        via.append(passed)
        lines.append(FrameRegion(line, leg=len(via)))
    speed = [] if move.speed is None else [FrameSpeedLimit(move.speed)]
    given = dict(cycle.conditions)
    constraints = [*given.pop("path_constraints", ()), *move.path_constraints, *speed, *lines]
    obstacles = [*given.pop("obstacles", ()), *move.obstacles]
    for name in ("allowed_contacts", "end_contacts"):
        given[name] = _present(given.get(name, ()), cycle, robot, obstacles)
    with naming_step(leg.step, leg.name):
        return MinimumTimeProblem(
            robot, q_start=q_start, q_goal=q_goal, via=via, obstacles=obstacles, path_constraints=constraints, **given
        )


def check_paths(cycle: Cycle, positions: Sequence[Sequence[Array]]) -> None:
    """Refuse moves to where the arm is, way points and straight segments out of reach, and blends without room.

    A blend leaves no room where it holds an end of its move. Of a move to where the arm is only detours would be left:
    from one branch of the same pose to another.

    In a free order a move may begin at several stops, so that only the search knows.

    Args:
        cycle: of moves in a given order.
        positions: branches of every stop.

    Raises:
        CycleError: one is refused between all branches that were tried, with the step's number and name.
    """
    for k, leg in enumerate(cycle.moves if cycle.order == "given" else ()):
        if _is_there_already(leg, cycle.stops[k + 1].target, positions[k]):
            raise CycleError(leg.step, leg.name, "the arm is there already: leave the step out, or give it a way point")
        refused = ""
        for ends in islice(product(positions[k], positions[k + 1]), CyclePolicy().alike):
            try:
                _check_path(cycle, leg, ends)
                break
            except ProblemError as error:
                refused = str(error)
                if _exact(cycle.stops[k].target) and _exact(cycle.stops[k + 1].target):
                    raise CycleError(leg.step, leg.name, refused) from None
        else:
            raise CycleError(leg.step, leg.name, refused)


def _is_there_already(leg: Leg, target: Array | GoalPose, begins: Sequence[Array]) -> bool:
    """Whether a move without way points and straight segments ends wherever it may begin."""
    move = leg.move
    if move.via or move.retreat or move.approach:
        return False
    if not isinstance(target, GoalPose):
        return all(np.array_equal(q, target) for q in begins)
    most = target.deviations + REACHED
    return all(np.all(np.abs(deviations_of(leg.robot, target, q)) <= most) for q in begins)


def _exact(target: object) -> bool:
    """Whether all branches of a stop bring the frame to one place."""
    return not isinstance(target, GoalPose) or target.exact


def _check_path(cycle: Cycle, leg: Leg, ends: tuple[Array, Array]) -> None:
    """Refuse a way point or a straight segment that a move cannot pass between joint positions."""
    move, robot, limits = leg.move, leg.robot, limits_of(cycle)
    via = [one if isinstance(one, GoalPose) else pose_given(robot, one, "via") for one in move.via]
    found = via_positions(robot, limits, ends, via, lambda q: True)
    check_via_regions(robot, via, np.array([ends[0], *found, ends[1]]))
    for name, straight, q in (("retreat", move.retreat, ends[0]), ("approach", move.approach, ends[1])):
        if isinstance(straight, Straight):
            try:
                via_positions(robot, limits, (q, q), [_on_line(robot, straight, move.to, q)[0]], lambda q: True)
            except ProblemError as error:
                why = str(error).removeprefix("via[0]: ")
                raise ProblemError(
                    f"the far end of its {name} of {straight.length:g} m is out of reach: {why}"
                ) from None


def _on_line(robot: Robot, straight: Straight, to: object, q: Array) -> tuple[GoalPose, GoalPose]:
    """Region at the far end of a straight segment that ends at q, and region of the line between both ends."""
    frame = straight.frame or (to.frame if isinstance(to, GoalPose) else robot.tip)
    at, letter = frame_placement(robot, frame, q), straight.axis[-1]
    axis = "xyz".index(letter)
    away = np.zeros(3)
    away[axis] = straight.length if straight.axis.startswith("-") else -straight.length
    # So that two deviations across, and three turns, together stay within the tolerance.
    across, turn = straight.deviation / np.sqrt(2), straight.angle / np.sqrt(3)
    most = [across, across, across, turn, turn, turn]
    most[axis] = 0.0
    far = at * pin.SE3(np.eye(3), away)
    passed = GoalPose(frame, far.homogeneous, tolerance=tuple(most))
    return passed, GoalPose(frame, at.homogeneous, free=(letter,), tolerance=tuple(most))


def _present(pairs: Any, cycle: Cycle, robot: Robot, obstacles: Sequence[Any]) -> Any:
    """Pairs of names without those of parts that are not carried and of obstacles of other moves."""
    if not isinstance(pairs, list | tuple):
        return pairs
    here = {*(body.name for body in robot.attached), *(getattr(one, "name", "") for one in obstacles)}
    elsewhere = {
        *(body.name for arm in cycle.arms for body in arm.attached),
        *(getattr(one, "name", "") for leg in cycle.moves for one in leg.move.obstacles),
    } - here
    return [pair for pair in pairs if not (isinstance(pair, list | tuple) and elsewhere.intersection(map(str, pair)))]
