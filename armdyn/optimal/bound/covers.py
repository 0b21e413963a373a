"""Regions that enclose all joint positions of a chain of legs at its stops, for a largest duration.

The places between two single joint positions are covered together: positions reachable within the velocity limits, from
the one, through boxes of all places between, to the other in time. Coarse boxes are pruned before they are bisected.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from armdyn.arguments import StopCondition
from armdyn.arrays import Array, Flags
from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.bound.effort import polled
from armdyn.optimal.bound.goal_set import GoalSet, Within, clusters
from armdyn.optimal.bound.interval import TURN, Interval, down, up
from armdyn.optimal.bound.lattice import Region
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.reach import least_time

Place = Array | GoalPose

_ROUNDED = 1e-12
"""Part by which a time is reduced: sums of a few dozen floats err by 1e-15 each."""


def covers(
    legs: Sequence[BoundLeg], places: Sequence[Place], longest: float, stop: StopCondition
) -> list[list[Region]]:
    """Regions of consecutive places.

    Args:
        legs: legs, one less than places.
        places: joint positions, shape (nv,), or goal sets of a frame's pose.
        longest: largest duration through all places [s].
        stop: stopping condition, polled regularly.

    Raises:
        Stopped: it is true.
    """
    ends = tuple(place for place in (places[0], places[-1]) if not isinstance(place, GoalPose))
    velocity = np.max([leg.velocity for leg in legs], axis=0)
    sets: list[GoalSet | None] = []
    boxes: list[Interval] = []
    for k, place in enumerate(places):
        if not isinstance(place, GoalPose):
            sets.append(None)
            boxes.append(Interval.at(place)[None])
            continue
        own = legs[max(k - 1, 0) : k + 1]
        position = own[0].position.meet(own[-1].position)
        if not ends:
            position = _of_one_turn(position, velocity, own[0].dynamics.robot.slides, longest)
        within = Within(ends, velocity, position, longest)
        goals = GoalSet(own[0].dynamics, place, within, own[0].policy)
        whole = goals.whole
        sets.append(None if whole is None else goals)
        boxes.append(within.box[None] if whole is None else whole)
    tried = [boxes]
    for size in polled(legs[0].policy.cover, stop):
        finer = [
            box if goals is None else goals.enclosed(box, size, stop)
            for goals, box in zip(sets, tried[-1], strict=True)
        ]
        if not _few([len(box.lower) for box in finer], legs):
            break  # the region itself is as large as that
        tried.append(_thinned(legs, sets, finer, longest, stop))
    for boxes in reversed(tried):
        regions = [_regions(goals, box, stop) for goals, box in zip(sets, boxes, strict=True)]
        if _few([len(each) for each in regions], legs):
            break
    return regions


def _of_one_turn(position: Interval, velocity: Array, slides: Flags, longest: float) -> Interval:
    """Limits of a chain whose endless joints start within one turn: motions are the same after whole turns."""
    endless = ~slides & np.isinf(position.lower) & np.isinf(position.upper) & np.isfinite(velocity)
    far = up(up(velocity * longest) + TURN.upper)
    return Interval(np.where(endless, -far, position.lower), np.where(endless, far, position.upper))


def _few(counts: Sequence[int], legs: Sequence[BoundLeg]) -> bool:
    """Whether counts of boxes at consecutive stops give few enough pairs for the check by velocity limits."""
    return all(a * b <= legs[0].policy.most_pairs for a, b in pairwise(counts))


def _regions(goals: GoalSet | None, boxes: Interval, stop: StopCondition) -> list[Region]:
    """Regions of boxes: joined if they touch and joint positions are isolated, and turned by all whole turns."""
    if goals is None:
        return [Region(boxes)] if len(boxes.lower) else []
    if goals.continuous:
        parts = [boxes[k : k + 1] for k in range(len(boxes.lower))]
    else:
        parts = [goals.shrunk(part, stop) for part in polled(clusters(boxes, stop), stop)]
    turned = ((k, one) for k, part in polled(enumerate(parts), stop) if len(part.lower) for one in goals.turned(part))
    return [Region(boxes, goals, (k, turns)) for k, (boxes, turns) in turned]


def _thinned(
    legs: Sequence[BoundLeg],
    sets: Sequence[GoalSet | None],
    boxes: list[Interval],
    longest: float,
    stop: StopCondition,
) -> list[Interval]:
    """Boxes that a motion may pass within a time [s]."""
    none = np.zeros(legs[0].dynamics.nv, dtype=bool)
    turning = np.any([none, *(goals.turning for goals in sets if goals is not None)], axis=0)
    pairs = zip(legs, boxes[:-1], boxes[1:], strict=True)
    times = [least_time(a[:, None], b[None], leg.velocity, turning) for leg, a, b in polled(pairs, stop)]
    forward, backward = [np.zeros(len(boxes[0].lower))], [np.zeros(len(boxes[-1].lower))]
    for each in times:
        forward.append(np.min(forward[-1][:, None] + each, axis=0, initial=np.inf))
    for each in reversed(times):
        backward.insert(0, np.min(each + backward[0], axis=1, initial=np.inf))
    passed = [down(down(a + b)) for a, b in zip(forward, backward, strict=True)]
    return [box[time * (1 - _ROUNDED) < longest] for box, time in zip(boxes, passed, strict=True)]
