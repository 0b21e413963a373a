"""Lower bounds of one leg: by itself, and through regions and along lines.

All joint positions along a line from a known end are enclosed by a tube. The line is divided into slices. A box around
the joint positions of a slice, with a wide margin, is narrowed by the
equations of line and slice. If the result lies inside the box, no motion leaves the box within the slice: at the box's
face the frame would be off the line. The parts of two adjacent boxes in the plane between the slices lie in each
other's box, so that a motion that begins in one of the boxes is in the box of its frame's slice, as long as it does not
leave the slices.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pinocchio as pin

from armdyn.arguments import StopCondition, expect
from armdyn.arrays import Array
from armdyn.models.scene.reaching import GoalPose, slid
from armdyn.optimal.bound.cells import Cells, Phase, reached
from armdyn.optimal.bound.enclosure import Interval, joined, sum_down, up
from armdyn.optimal.bound.frame_sets import BoundRegion, GoalSet, Within
from armdyn.optimal.bound.leg import BoundLeg, LegEnd, least_time
from armdyn.optimal.bound.proof import proven, relaxed
from armdyn.optimal.problem.checks import ROUNDING


def leg_bound(leg: BoundLeg, stop: StopCondition, known: float = 0.0) -> tuple[float, int]:
    """Lower bound on the duration of a leg [s], and the joint that decides it.

    Args:
        leg: leg to one goal, or to all in a box.
        stop: stopping condition, polled regularly; once true, the bound so far is returned.
        known: bound that is already proven [s].
    """
    alone = leg.alone(leg.away)
    known, joint = max(known, float(np.max(alone))), int(np.argmax(alone))
    if known == 0 or not leg.has_momentum:
        return known, joint
    numbers, horizon = leg.policy, leg.policy.horizon
    for _ in range(numbers.grids):
        before = known
        known, joint, full = _on_grid(leg, known, joint, (1 + horizon) * known, stop)
        if stop() or not full or known < before * (1 + numbers.regrid):
            break
        horizon = min(max(2 * (known / before - 1), numbers.least_horizon), numbers.horizon)
    return known, joint


def _on_grid(leg: BoundLeg, known: float, joint: int, longest: float, stop: StopCondition) -> tuple[float, int, bool]:
    """Bound by cells for a motion of the known duration, its joint, and whether ramps fill the cells."""
    cells, full, cut, numbers = Cells.of(leg, known / 2, longest), False, False, leg.policy
    for done in range(numbers.passes):
        if cells is None:
            return longest, joint, True
        if stop():
            break
        forces = cells.forces(leg)
        if done:  # the first boxes are too wide for a useful program
            ends = cells.ends(leg)
            by = relaxed(leg, cells, forces, ends, known)
            if by is None:
                break
            before, bound = known, min(proven(leg, cells, forces, ends, by), longest)
            if bound > known:
                known, joint = bound, int(np.argmax(by.way[0] * leg.away.centre))
            half, ramp = float(np.sum(cells.side)), by.ramp(leg, cells)
            full = not cut and ramp > 0
            if 0 < ramp * numbers.cut_side < half and not cut:
                cells, cut = cells.cut(leg, ramp * numbers.cut_side), True
                continue
            if known < before * (1 + numbers.least_gain):
                break
        if done + 1 < numbers.passes:
            cells = cells.narrowed(leg, reached(leg, cells, forces, stop))
    return known, joint, full or known == longest


def phased_bound(leg: BoundLeg, phases: Sequence[Phase], known: float, longest: float, stop: StopCondition) -> float:
    """Lower bound on the duration of a leg in phases [s].

    Args:
        leg: leg between joint positions, or boxes of them.
        phases: phases of the leg.
        known: bound that is already proven [s].
        longest: duration up to which motions are covered [s], an upper limit of the bound.
        stop: stopping condition, polled regularly; once true, the bound so far is returned.
    """
    cells = Cells.in_phases(leg, phases, longest)
    if cells is not None and (np.all(cells.elastic) or not leg.has_momentum):
        return known  # momentum gives no bound if motions may take no time
    cells = None if cells is None else cells.narrowed(leg, reached(leg, cells, cells.forces(leg), stop))
    if cells is None:
        return longest
    forces, ends = cells.forces(leg), cells.ends(leg)
    by = None if stop() else relaxed(leg, cells, forces, ends, known)
    return known if by is None else max(known, min(proven(leg, cells, forces, ends, by), longest))


@dataclass(frozen=True, eq=False)
class Passage:
    """Regions and lines that a leg passes, in order.

    Attributes:
        regions: regions in order, passed at any velocity.
        lines: regions in which a frame stays during a phase between two of these, by the phase's index. Only the lines
            of the first and the last phase are used.
    """

    regions: tuple[BoundRegion, ...]
    lines: Mapping[int, BoundRegion]


def passing_bound(
    leg: BoundLeg, passage: Passage, known: float, longest: float, stop: StopCondition
) -> tuple[float, bool]:
    """Lower bound on the duration of a leg through regions [s], and whether further tries would gain nothing.

    Args:
        leg: leg between joint positions, or boxes of them.
        passage: regions and lines on the way.
        known: bound that is already proven [s].
        longest: duration up to which motions are covered [s], an upper limit of the bound.
        stop: stopping condition, polled regularly; once true, the bound so far is returned.
    """
    numbers, begun, longest = leg.policy, known, min(longest, (1 + leg.policy.horizon / 2) * known)
    phases = _phases(leg, passage, longest, stop)
    if phases is None:
        return longest, longest == begun
    known = max(known, min(sum_down([phase.least for phase in phases]), longest))
    near = min(longest, (1 + numbers.region_horizon) * known)
    for _ in range(numbers.passes):
        before, known = known, max(known, phased_bound(leg, phases, known, near, stop))
        if stop() or known == longest or (known < near and known < before * (1 + numbers.regrid)):
            break
        # The shorter the covered motions, the smaller the boxes; if the bound reaches them, try longer ones.
        near = min(longest, (known + near) / 2 if known < near else (1 + numbers.region_horizon) * known)
    return known, known < longest or known == begun


@dataclass(frozen=True, eq=False)
class _Event:
    """Boundary between two consecutive phases.

    Attributes:
        region: region of the frame.
        box: box of all joint positions in the region, each end of shape (nv,).
        line_box: box of all joint positions in the phase along the line to or from the region; None: no line.
    """

    region: BoundRegion
    box: Interval
    line_box: Interval | None = None


def _phases(leg: BoundLeg, passage: Passage, longest: float, stop: StopCondition) -> list[Phase] | None:
    """Phases of motions of at most a duration [s]; None: no such motions exist."""
    events = _events(leg, passage, longest, stop)
    if events is None:
        return None
    last = len(events)
    ends = [leg.start, *(event.region.end(event.box) for event in events), leg.goal]
    legs = [replace(leg, start=start, goal=goal) for start, goal in pairwise(ends)]
    goals = [*((event.region, event.box) for event in events), None]
    phases = [Phase(own.shortest, leg.position, goal=goal) for own, goal in zip(legs, goals, strict=True)]
    for k, event in ((0, events[0]), (last, events[-1])):
        if k in passage.lines and event.line_box is not None:
            phases[k] = replace(phases[k], line=passage.lines[k], box=event.line_box)
        others = sum_down([phase.least for j, phase in enumerate(phases) if j != k])
        least = _alone(legs[k], phases[k], event, k == 0, longest - others, stop)
        phases[k] = replace(phases[k], least=max(phases[k].least, least))
    return phases


def _alone(leg: BoundLeg, phase: Phase, event: _Event, first: bool, longest: float, stop: StopCondition) -> float:
    """Least time of the first or last phase by itself [s], given the event at its other end."""
    numbers = leg.policy
    known, _ = leg_bound(replace(leg, policy=numbers.between_wide), stop)
    known = max(known, phase.least)
    for _ in range(2 * numbers.passes):  # each covers motions that are a little longer
        if stop() or known == 0 or known >= longest:
            break
        before, most = known, min((1 + numbers.phase_horizon) * known, longest)
        far = up(leg.velocity * most)
        box = ((leg.start if first else leg.goal).q + Interval(-far, far)).intersection(event.box)
        near = event.region.narrowed(box[None], numbers) if np.all(box.lower <= box.upper) else None
        if near is None:
            known = most
            continue
        passed = event.region.end(near[0])
        one = replace(leg, goal=passed) if first else replace(leg, start=passed)
        known = phased_bound(one, [replace(phase, least=known, goal=None)], known, most, stop)
        if known < before * (1 + numbers.least_horizon):
            break
    return known


def _events(leg: BoundLeg, passage: Passage, longest: float, stop: StopCondition) -> list[_Event] | None:
    """Events at which a motion meets its regions; None: impossible within a duration [s].

    A motion along a line into a region crosses the plane in front of the region. The event is its first crossing.
    """
    regions, count = passage.regions, len(passage.regions)
    found: list[_Event | None] = [None] * count
    if 0 in passage.lines:
        found[0] = _on_line(leg, passage.lines[0], regions[0], (leg.start, leg.goal), longest)
    if count in passage.lines and found[-1] is None:
        found[-1] = _on_line(leg, passage.lines[count], regions[-1], (leg.goal, leg.start), longest)
    for k, region in enumerate(regions):
        if found[k] is None:
            box = _enclosed(leg, region, longest, stop)
            if box is None:
                return None
            found[k] = _Event(region, box)
    return [event for event in found if event is not None]


def _on_line(
    leg: BoundLeg, line: BoundRegion, region: BoundRegion, ends: tuple[LegEnd, LegEnd], longest: float
) -> _Event | None:
    """Event on a line from one of the leg's ends, given the other end; None: unknown."""
    axis, goal, passed = line.free, line.goal, region.goal
    if axis is None or goal.frame != passed.frame:
        return None
    off = goal.pose.actInv(passed.pose)
    deviation = float(np.abs(off.rotation[axis]) @ passed.deviations[:3])
    plane = float(np.copysign(max(abs(off.translation[axis]) - deviation, 0.0), off.translation[axis]))
    if not np.isfinite(deviation) or plane == 0:
        return None
    found = tube(leg, line, plane, ends, longest)
    if found is None:
        return None
    at = goal.pose * pin.SE3(np.eye(3), plane * np.eye(3)[axis])
    free = tuple(name for name in goal.free if name != "xyz"[axis])
    box, across = found
    return _Event(BoundRegion(line.dynamics, GoalPose(goal.frame, at.homogeneous, free, goal.tolerance)), across, box)


def _enclosed(leg: BoundLeg, region: BoundRegion, longest: float, stop: StopCondition) -> Interval | None:
    """A box of all joint positions in a region that a motion passes within a duration [s]; None: there are none."""
    within = Within((leg.start.q.centre, leg.goal.q.centre), leg.velocity, leg.position, longest)
    goals, box = GoalSet(leg.dynamics, region.goal, within, leg.policy), within.box
    boxes = None if np.any(leg.start.q.radius) or np.any(leg.goal.q.radius) else goals.whole
    if boxes is not None:
        first, *finer = leg.policy.cover
        for size in (first / 2, *finer):  # regions are smaller than the sets of a chain's stops
            boxes = goals.enclosed(boxes, size, stop)
        turned = [one for one, _ in goals.turned(boxes)] if len(boxes.lower) else []
        if not turned:
            return None
        box = joined(turned).around.intersection(within.box)
    found = region.narrowed(box[None], leg.policy)
    return None if found is None else found[0]


def tube(
    leg: BoundLeg, line: BoundRegion, plane: float, ends: tuple[LegEnd, LegEnd], longest: float
) -> tuple[Interval, Interval] | None:
    """Tube of joint positions along a line, from a known end to a plane across it.

    Args:
        leg: leg with velocity limits and policy.
        line: region with one free axis.
        plane: position of the plane along that axis [m]; the frame rests at 0.
        ends: ends of the leg: the one with the frame at rest on the line, and the other one.
        longest: largest duration from end to end [s].

    Returns:
        Box of all positions before the frame first meets the plane, each end of shape (nv,), and of those in the plane,
        likewise; None: they cannot be separated from other joint positions.
    """
    end, other = (one.q for one in ends)
    slices = _slices(leg, line, plane, (end, other), longest)
    if slices is None:
        return None
    boxes, middles, half, first = slices
    numbers, margin = leg.policy, half * ROUNDING
    inner = line.narrowed(boxes, numbers, Interval(middles - half - margin, middles + half + margin))
    if inner is None or not _inside(inner, boxes) or not _inside(end[None], boxes[first : first + 1]):
        return None
    edges = (middles[:-1] + middles[1:]) / 2
    for own, neighbours in ((inner[:-1], boxes[1:]), (inner[1:], boxes[:-1])):
        faces = line.narrowed(own, numbers, Interval(edges - margin, edges + margin))
        if faces is None or not _inside(faces, neighbours):
            return None
    last = line.narrowed(inner[-1:], numbers, Interval(np.array([plane - margin]), np.array([plane + margin])))
    # The line continues behind the slices. A motion that reaches the outermost slice has no time left after it:
    # a later crossing of the plane need not be considered.
    if last is None or _time(leg, (end, inner[0], other)) < longest:
        return None
    return inner[1:].around, last[0]


def _time(leg: BoundLeg, boxes: Sequence[Interval]) -> float:
    """Time from box to box by the velocity limits [s], rounded down."""
    return sum_down([float(least_time(one, other, leg.velocity)) for one, other in pairwise(boxes)])


def _slices(
    leg: BoundLeg, line: BoundRegion, plane: float, ends: tuple[Interval, Interval], longest: float
) -> tuple[Interval, Array, float, int] | None:
    """Boxes of the slices, shape (m, nv), their middles and half width along the line [m], and the end's index.

    They extend from the plane to the end, which is in the middle of its slice, and beyond as far as time allows.
    """
    numbers, count, (end, other) = leg.policy, max(round(abs(plane) / (leg.policy.sizes[1] / 2)), 1), ends
    half = abs(plane) / (2 * count + 1)
    step = float(np.copysign(2 * half, plane))
    ahead, behind = [end.centre], [end.centre]
    while len(ahead) <= count:
        following = _slid(leg, line, len(ahead) * step, ahead[-1])
        if following is None:
            return None
        ahead.append(following)
    wide = 2 * numbers.sizes[0]
    while _time(leg, (end, Interval(behind[-1] - wide, behind[-1] + wide), other)) <= longest:
        following = _slid(leg, line, -len(behind) * step, behind[-1])
        if following is None or len(behind) > 2 * numbers.phase_cells:
            return None
        behind.append(following)
    first, q = len(behind) - 1, np.array([*behind[:0:-1], *ahead])
    wide = np.max(np.abs(np.diff(q, axis=0)), axis=0) + end.radius + numbers.sizes[0]
    return Interval(q - wide, q + wide), np.asarray(step * (np.arange(len(q)) - first)), half, first


def _slid(leg: BoundLeg, line: BoundRegion, along: float, q: Array) -> Array | None:
    """Joint positions near q with the frame at a distance along the line's free axis [m]; None if not found."""
    at = line.goal.pose * pin.SE3(np.eye(3), along * np.eye(3)[expect(line.free, int, "line")])
    return slid(leg.dynamics.robot, GoalPose(line.goal.frame, at.homogeneous), q, np.zeros(len(q)), leg.torque)


def _inside(inner: Interval, outer: Interval) -> bool:
    return bool(np.all(inner.lower > outer.lower) and np.all(inner.upper < outer.upper))
