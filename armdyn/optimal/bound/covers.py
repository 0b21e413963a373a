"""Regions that hold all joint positions which a chain of legs may use at its stops, in some time at most.

The places between two that are one joint position each are covered together: what velocity limits lead to from the one,
through boxes of all places between, to the other in time. Coarse boxes are thinned out before they are cut smaller.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from armdyn.arguments import StopCondition
from armdyn.arrays import Array, Flags
from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.bound.enclosure.interval import TURN, Interval, down, up
from armdyn.optimal.bound.goal_set import GoalSet, Within, clusters
from armdyn.optimal.bound.lattice import Region
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.rates import soonest

Place = Array | GoalPose

_ROUNDED = 1e-12
"""Part of a time that is taken off: sums of a few dozen floats err by 1e-15 each."""


def covers(
    legs: Sequence[BoundLeg], places: Sequence[Place], longest: float, stop: StopCondition
) -> list[list[Region]]:
    """Regions of consecutive places.

    Args:
        legs: one less than places.
        places: joint positions, shape (nv,), or all that bring a frame to a pose.
        longest: time of a motion through all places [s], at most.
        stop: asked now and then; once it is true, boxes are not made smaller.
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
        whole = goals.whole if goals.closed else None
        sets.append(None if whole is None else goals)
        boxes.append(within.box[None] if whole is None else whole)
    tried = [boxes]
    for size in legs[0].policy.cover:
        finer = [
            box if goals is None else goals.enclosed(box, size, stop)
            for goals, box in zip(sets, tried[-1], strict=True)
        ]
        if not _few([len(box.lower) for box in finer], legs):
            break  # of a region that is itself as large as that
        tried.append(_thinned(legs, sets, finer, longest))
    for boxes in reversed(tried):
        regions = [_regions(goals, box, stop) for goals, box in zip(sets, boxes, strict=True)]
        if _few([len(each) for each in regions], legs):
            break
    return regions


def _of_one_turn(position: Interval, velocity: Array, slides: Flags, longest: float) -> Interval:
    """Limits of a chain whose endless joints begin within a turn: after whole turns all motions are the same."""
    endless = ~slides & np.isinf(position.lower) & np.isinf(position.upper) & np.isfinite(velocity)
    far = up(up(velocity * longest) + TURN.upper)
    return Interval(np.where(endless, -far, position.lower), np.where(endless, far, position.upper))


def _few(counts: Sequence[int], legs: Sequence[BoundLeg]) -> bool:
    """Whether boxes of consecutive places, so many at each, have few enough pairs to check against velocity limits."""
    return all(a * b <= legs[0].policy.most_pairs for a, b in pairwise(counts))


def _regions(goals: GoalSet | None, boxes: Interval, stop: StopCondition) -> list[Region]:
    """Boxes, those that touch joined where joint positions are isolated, turned by all whole turns."""
    if goals is None:
        return [Region(boxes)] if len(boxes.lower) else []
    if goals.continuous:
        parts = [boxes[k : k + 1] for k in range(len(boxes.lower))]
    else:
        parts = [goals.shrunk(part, stop) for part in clusters(boxes, stop)]
    turned = ((k, one) for k, part in enumerate(parts) if len(part.lower) for one in goals.turned(part))
    return [Region(boxes, goals, (k, turns)) for k, (boxes, turns) in turned]


def _thinned(
    legs: Sequence[BoundLeg], sets: Sequence[GoalSet | None], boxes: list[Interval], longest: float
) -> list[Interval]:
    """Boxes without those that no motion passes in some time [s]."""
    none = np.zeros(legs[0].dynamics.nv, dtype=bool)
    turning = np.any([none, *(goals.turning for goals in sets if goals is not None)], axis=0)
    pairs = zip(legs, boxes[:-1], boxes[1:], strict=True)
    times = [soonest(a[:, None], b[None], leg.velocity, turning) for leg, a, b in pairs]
    onward, back = [np.zeros(len(boxes[0].lower))], [np.zeros(len(boxes[-1].lower))]
    for each in times:
        onward.append(np.min(onward[-1][:, None] + each, axis=0, initial=np.inf))
    for each in reversed(times):
        back.insert(0, np.min(each + back[0], axis=1, initial=np.inf))
    passed = [down(down(a + b)) for a, b in zip(onward, back, strict=True)]
    return [box[time * (1 - _ROUNDED) < longest] for box, time in zip(boxes, passed, strict=True)]
