"""Lower bound of a leg that passes regions, and follows lines between them: its phases, each bounded alone, then all."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from armdyn.optimal.bound.course import Phase
from armdyn.optimal.bound.course_bound import course_bound
from armdyn.optimal.bound.enclosure.interval import Interval, down, sum_down, up
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.leg_bound import leg_bound
from armdyn.optimal.bound.region import BoundRegion
from armdyn.optimal.bound.tube import Tube, tube

Stop = Callable[[], bool]


@dataclass(frozen=True, eq=False)
class Passage:
    """What a leg passes on its way.

    Attributes:
        regions: passed at any velocity, in this order.
        lines: regions in which a frame stays, by the number of the phase between those; of the first and the last one.
    """

    regions: tuple[BoundRegion, ...]
    lines: Mapping[int, BoundRegion]


def passing_bound(leg: BoundLeg, passage: Passage, known: float, stop: Stop) -> float:
    """Lower bound on the duration of a leg that passes regions [s].

    Args:
        leg: between joint positions, or boxes of them.
        passage: what it passes.
        known: a bound that is proven already [s].
        stop: polled now and then; once it is true, the bound that is proven so far is returned.
    """
    numbers = leg.policy
    for _ in range(numbers.course_grids):
        before, longest = known, (1 + numbers.course_ahead) * known
        phases = _phases(leg, passage, longest, stop)
        if phases is None:
            return longest
        known = max(known, min(sum_down([phase.least for phase in phases]), longest))
        known = course_bound(leg, phases, known, longest, stop)
        if stop() or known < before * (1 + numbers.regrid):
            break
    return known


def _phases(leg: BoundLeg, passage: Passage, longest: float, stop: Stop) -> list[Phase] | None:
    """The phases of motions that take no longer than some time [s]; None: there are no such motions."""
    count = len(passage.regions)
    tubes = {k: _tube(leg, passage, k, longest) for k in passage.lines if k in (0, count)}
    boxes = []
    for k, region in enumerate(passage.regions):
        own = [one for one in (tubes.get(k) if k == 0 else None, tubes.get(count) if k == count - 1 else None) if one]
        box = own[0].plane if own else region.narrowed(_within_reach(leg, longest)[None], leg.policy)
        if box is None:
            return None
        boxes.append(box if own else box[0])
    inner = [region.end(box) for region, box in zip(passage.regions, boxes, strict=True)]
    ends = [leg.start, *inner, leg.goal]
    legs = [replace(leg, start=start, goal=goal) for start, goal in pairwise(ends)]
    phases = []
    for k, own in enumerate(legs):
        around = tubes.get(k)
        goal = (passage.regions[k], boxes[k]) if k < count else None
        phases.append(Phase(own.shortest, around.box if around else leg.position, passage.lines.get(k), goal))
    for k in (0, count):
        others = sum_down([phase.least for j, phase in enumerate(phases) if j != k])
        phases[k] = replace(phases[k], least=_alone(legs[k], phases[k], longest - others, stop))
    return phases


def _alone(leg: BoundLeg, phase: Phase, longest: float, stop: Stop) -> float:
    """Least time of a phase by itself [s]."""
    numbers = leg.policy
    known, _ = leg_bound(replace(leg, policy=replace(numbers, grids=1, passes=numbers.wide_passes)), stop)
    for _ in range(numbers.phase_grids):
        if stop() or known == 0:
            break
        most = min((1 + numbers.phase_ahead) * known, longest)
        before = known
        known = course_bound(leg, [replace(phase, least=known, goal=None)], known, most, stop)
        if known < before * (1 + numbers.phase_worth) or most == longest:
            break
    return known


def _tube(leg: BoundLeg, passage: Passage, k: int, longest: float) -> Tube | None:
    """The tube of the first or of the last phase; None: none is known."""
    line, first = passage.lines[k], k == 0
    region, end, other = (
        (passage.regions[0], leg.start, leg.goal) if first else (passage.regions[-1], leg.goal, leg.start)
    )
    if line.free is None or line.goal.frame != region.goal.frame:
        return None
    plane = float(line.goal.pose.actInv(region.goal.pose).translation[line.free])
    found = tube(leg, line, plane, end, longest)
    if found is None:
        return None
    beyond = float(np.max(down((other.q - found.plane).mignitude / leg.velocity)))
    return tube(leg, line, plane, end, longest - beyond) or found


def _within_reach(leg: BoundLeg, longest: float) -> Interval:
    """Joint positions that velocity limits let a motion pass in some time [s]."""
    far = up(leg.velocity * longest)
    box = leg.position
    for end in (leg.start.q, leg.goal.q):
        near = end + Interval(-far, far)
        box = Interval(np.maximum(box.lower, near.lower), np.minimum(box.upper, near.upper))
    return box
