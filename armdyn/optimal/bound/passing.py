"""Lower bound of a leg that passes regions and follows lines to and from them: its phases alone, then all of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pinocchio as pin

from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.bound.course import Phase
from armdyn.optimal.bound.course_bound import course_bound
from armdyn.optimal.bound.enclosure.interval import Interval, sum_down, up
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.leg_bound import leg_bound
from armdyn.optimal.bound.region import BoundRegion
from armdyn.optimal.bound.tube import tube

Stop = Callable[[], bool]


@dataclass(frozen=True, eq=False)
class Passage:
    """What a leg passes on its way.

    Attributes:
        regions: passed at any velocity, in this order.
        lines: regions in which a frame stays in a phase, from one of these to the next, by the phase's number. Those of
            the first and of the last phase count.
    """

    regions: tuple[BoundRegion, ...]
    lines: Mapping[int, BoundRegion]


def passing_bound(leg: BoundLeg, passage: Passage, known: float, longest: float, stop: Stop) -> float:
    """Lower bound on the duration of a leg that passes regions [s].

    Args:
        leg: between joint positions, or boxes of them.
        passage: what it passes.
        known: a bound that is proven already [s].
        longest: no motion that takes longer [s] is spoken of: the bound is no more than that.
        stop: polled now and then; once it is true, the bound that is proven so far is returned.
    """
    for _ in range(leg.policy.course_grids):
        most = min(longest, (1 + leg.policy.passing_ahead) * known)
        known = _within(leg, passage, known, most, stop)
        if known < most or known == longest or stop():
            break
    return known


def _within(leg: BoundLeg, passage: Passage, known: float, longest: float, stop: Stop) -> float:
    """The bound for motions that take no longer than some time [s]."""
    numbers, phases = leg.policy, _phases(leg, passage, longest, stop)
    if phases is None:
        return longest
    known = max(known, min(sum_down([phase.least for phase in phases]), longest))
    near = min(longest, (1 + numbers.course_ahead) * known)
    for _ in range(numbers.course_grids):
        before, known = known, max(known, course_bound(leg, phases, known, near, stop))
        if stop() or known == longest or (known < near and known < before * (1 + numbers.regrid)):
            break
        # The nearer the longest motion spoken of, the smaller the boxes; where the bound is as much, there is more.
        near = min(longest, (known + near) / 2 if known < near else (1 + numbers.course_ahead) * known)
    return known


@dataclass(frozen=True, eq=False)
class _Event:
    """Where one phase ends and the next one begins.

    Attributes:
        region: of the frame.
        box: of all joint positions there, each end of shape (nv,).
        beside: of all joint positions in the phase along the line that leads there or away; None: there is no line.
    """

    region: BoundRegion
    box: Interval
    beside: Interval | None = None


def _phases(leg: BoundLeg, passage: Passage, longest: float, stop: Stop) -> list[Phase] | None:
    """The phases of motions that take no longer than some time [s]; None: there are no such motions."""
    events = _events(leg, passage, longest)
    if events is None:
        return None
    last = len(events)
    ends = [leg.start, *(event.region.end(event.box) for event in events), leg.goal]
    legs = [replace(leg, start=start, goal=goal) for start, goal in pairwise(ends)]
    phases = [Phase(own.shortest, leg.position) for own in legs]
    for k, event in enumerate(events):
        phases[k] = replace(phases[k], goal=(event.region, event.box))
    for k, event in ((0, events[0]), (last, events[-1])):
        if k in passage.lines and event.beside is not None:
            phases[k] = replace(phases[k], line=passage.lines[k], box=event.beside)
        others = sum_down([phase.least for j, phase in enumerate(phases) if j != k])
        least = _alone(legs[k], phases[k], longest - others, stop)
        phases[k] = replace(phases[k], least=max(phases[k].least, least))
    return phases


def _alone(leg: BoundLeg, phase: Phase, longest: float, stop: Stop) -> float:
    """Least time of a phase by itself [s]."""
    numbers = leg.policy
    known, _ = leg_bound(replace(leg, policy=replace(numbers, grids=1, passes=numbers.wide_passes)), stop)
    for _ in range(numbers.phase_grids):
        if stop() or known == 0 or known >= longest:
            break
        before, most = known, min((1 + numbers.phase_ahead) * known, longest)
        known = course_bound(leg, [replace(phase, least=known, goal=None)], known, most, stop)
        if known < before * (1 + numbers.phase_worth):
            break
    return known


def _events(leg: BoundLeg, passage: Passage, longest: float) -> list[_Event] | None:
    """Where a motion meets its regions; None: it cannot in some time [s].

    A motion that follows a line into a region crosses the plane in front of the region on its way. The first time it
    does so is the event.
    """
    regions, count = passage.regions, len(passage.regions)
    found: list[_Event | None] = [None] * count
    if 0 in passage.lines:
        found[0] = _on_line(leg, passage.lines[0], regions[0], (leg.start, leg.goal), longest)
    if count in passage.lines and found[-1] is None:
        found[-1] = _on_line(leg, passage.lines[count], regions[-1], (leg.goal, leg.start), longest)
    for k, region in enumerate(regions):
        if found[k] is None:
            box = region.narrowed(_within_reach(leg, longest)[None], leg.policy)
            if box is None:
                return None
            found[k] = _Event(region, box[0])
    return [event for event in found if event is not None]


def _on_line(
    leg: BoundLeg, line: BoundRegion, region: BoundRegion, ends: tuple[LegEnd, LegEnd], longest: float
) -> _Event | None:
    """The event on a line from one of the leg's ends, the other end given; None: none is known."""
    axis, goal, passed = line.free, line.goal, region.goal
    if axis is None or goal.frame != passed.frame:
        return None
    off = goal.pose.actInv(passed.pose)
    beside = float(np.abs(off.rotation[axis]) @ passed.deviations[:3])
    plane = float(np.copysign(max(abs(off.translation[axis]) - beside, 0.0), off.translation[axis]))
    if not np.isfinite(beside) or plane == 0:
        return None
    found = tube(leg, line, plane, ends, longest)
    if found is None:
        return None
    at = goal.pose * pin.SE3(np.eye(3), plane * np.eye(3)[axis])
    free = tuple(name for name in goal.free if name != "xyz"[axis])
    return _Event(
        BoundRegion(line.dynamics, GoalPose(goal.frame, at.homogeneous, free, goal.tolerance)), found.plane, found.box
    )


def _within_reach(leg: BoundLeg, longest: float) -> Interval:
    """Joint positions that velocity limits let a motion pass in some time [s]."""
    far = up(leg.velocity * longest)
    box = leg.position
    for end in (leg.start.q, leg.goal.q):
        near = end + Interval(-far, far)
        box = Interval(np.maximum(box.lower, near.lower), np.minimum(box.upper, near.upper))
    return box
