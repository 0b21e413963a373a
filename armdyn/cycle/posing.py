"""From a leg of a cycle and joint positions at its ends to a minimum-time problem."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from armdyn.cycle.cycle import Cycle, Leg, told
from armdyn.cycle.steps import Straight
from armdyn.errors import CycleError
from armdyn.models.robots.robot import Robot
from armdyn.optimal.path_constraints.limits.frame_speed import FrameSpeedLimit
from armdyn.optimal.problem.problem import MinimumTimeProblem

Array = NDArray[np.float64]


def problem_of(cycle: Cycle, leg: Leg, q_start: Array, q_goal: Array) -> MinimumTimeProblem:
    """The problem of a leg between joint positions.

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
    if isinstance(move.retreat, Straight) or isinstance(move.approach, Straight):
        raise CycleError(leg.step, leg.name, "straight segments are not solved yet; give via poses instead")
    speed = [] if move.speed is None else [FrameSpeedLimit(move.speed)]
    given = dict(cycle.conditions)
    constraints = [*given.pop("path_constraints", ()), *move.path_constraints, *speed]
    obstacles = [*given.pop("obstacles", ()), *move.obstacles]
    for name in ("allowed_contacts", "end_contacts"):
        given[name] = _present(given.get(name, ()), cycle, robot, obstacles)
    with told(leg.step, leg.name):
        return MinimumTimeProblem(
            robot, q_start=q_start, q_goal=q_goal, via=via, obstacles=obstacles, path_constraints=constraints, **given
        )


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
