"""How fast no motion within the limits can be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from armdyn.arguments import stopper
from armdyn.brief import brief
from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.enclosure.interval import down
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.leg import Leg, legs_of
from armdyn.optimal.bound.proof import proven
from armdyn.optimal.bound.reach import reached
from armdyn.optimal.bound.relaxation import relaxed
from armdyn.optimal.bound.terms import terms_over
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem

T = TypeVar("T")

_PASSES, _GRIDS = 8, 16
"""Of nested boxes on one grid, and grids, at most; usually it is four and one."""

_WORTH = 2e-5
"""A pass that raises the bound by a smaller share is the last."""

_REGRID = 1e-3
"""Where ramps meet in the middle and the bound has risen by more than this share, longer cells may raise it more."""

_FULL, _ROOM = 0.9, 1.5
"""Ramps that are longer than this share of a side fill it; shorter ones get sides that are longer by this factor."""

_AHEAD = 0.5
"""Motions that take longer by more than this share than is known to be needed are not spoken of, in one grid; later
twice what the last grid has brought, one hundredth at least: the nearer, the smaller the boxes in the middle."""


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
        ProblemError: problem is none, or stop no function.
        BridgeError: the dynamics have an operation that is not known in intervals.
    """
    legs, stopped = legs_of(expect_problem(problem)), stopper(stop)
    kinematic = _sum_down([leg.shortest for leg in legs])
    if kinematic == 0:
        return None
    found = [_of_leg(leg, stopped) for leg in legs]
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


def _of_leg(leg: Leg, stop: Callable[[], bool]) -> tuple[float, int]:
    """The bound of a leg [s], and the joint that decides it."""
    known, joint = leg.shortest, int(np.argmax(leg.kinematic))
    if known == 0 or not np.all(np.isfinite(leg.velocity)):
        return known, joint
    ahead = _AHEAD
    for _ in range(_GRIDS):
        before = known
        known, joint, full = _on_grid(leg, known, joint, (1 + ahead) * known, stop)
        if stop() or not full or known < before * (1 + _REGRID):
            break
        ahead = min(max(2 * (known / before - 1), 0.01), _AHEAD)
    return known, joint


def _on_grid(leg: Leg, known: float, joint: int, longest: float, stop: Callable[[], bool]) -> tuple[float, int, bool]:
    """The bound by cells for a motion as long as is known to be needed, its joint, and whether ramps fill the cells."""
    cells, full, cut = Cells.of(leg, known / 2, longest), False, False
    for done in range(_PASSES):
        if stop():
            break
        forces = Forces(terms_over(leg.dynamics, cells.q), cells.v, leg.torque, leg.friction)
        if done:  # the first boxes are too wide for a program to say much
            by = relaxed(leg, cells, forces, known)
            if by is None:
                break
            before, bound = known, min(proven(leg, cells, forces, by), longest)
            if bound > known:
                known, joint = bound, int(np.argmax(by.way * (leg.q_goal - leg.q_start)))
            half, ramp = float(np.sum(cells.side)), by.ramp(leg, cells)
            full = not cut and ramp > _FULL * half
            if 0 < ramp * _ROOM < half and not cut:
                cells, cut = cells.cut(leg, ramp * _ROOM), True
                continue
            if known < before * (1 + _WORTH):
                break
        cells = cells.narrowed(leg, reached(leg, cells, forces))
    return known, joint, full or known == longest
