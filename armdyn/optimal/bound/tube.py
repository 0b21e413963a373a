"""Boxes of all joint positions of a frame on a line that it follows from a known end.

The line is divided into slices. A box around the joint positions of a slice, with a wide margin, is narrowed by the
equations of line and slice. If the result lies inside the box, no motion leaves the box within the slice: at the box's
face the frame would be off the line. The parts of two adjacent boxes in the plane between the slices lie in each
other's box, so that a motion that begins in one of the boxes is in the box of its frame's slice, as long as it does not
leave the slices.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin

from armdyn.arguments import expect
from armdyn.arrays import Array
from armdyn.models.scene.reaching import GoalPose, slid
from armdyn.optimal.bound.interval import Interval, sum_down
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.rates import least_time
from armdyn.optimal.bound.region import BoundRegion

_SLACK = 1e-6
"""Share of a slice by which neighbours overlap, to cover rounding of their faces."""


@dataclass(frozen=True, eq=False)
class Tube:
    """Boxes of joint positions along a line, from a known end to a plane across it.

    Attributes:
        box: box of all positions before the frame first meets the plane, each end of shape (nv,).
        plane: box of the positions in the plane, likewise.
    """

    box: Interval
    plane: Interval


def tube(leg: BoundLeg, line: BoundRegion, plane: float, ends: tuple[LegEnd, LegEnd], longest: float) -> Tube | None:
    """The tube of a line; None: it cannot be separated from other joint positions.

    Args:
        leg: leg with velocity limits and policy.
        line: region with one free axis.
        plane: position of the plane along that axis [m]; the frame rests at 0.
        ends: ends of the leg: the one with the frame at rest on the line, and the other one.
        longest: largest duration from end to end [s].
    """
    end, other = (one.q for one in ends)
    slices = _slices(leg, line, plane, (end, other), longest)
    if slices is None:
        return None
    boxes, middles, half, first = slices
    numbers, margin = leg.policy, half * _SLACK
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
    return Tube(inner[1:].around, last[0])


def _time(leg: BoundLeg, boxes: Sequence[Interval]) -> float:
    """Time from box to box by the velocity limits [s], rounded down."""
    return sum_down([float(least_time(one, other, leg.velocity)) for one, other in pairwise(boxes)])


def _slices(
    leg: BoundLeg, line: BoundRegion, plane: float, ends: tuple[Interval, Interval], longest: float
) -> tuple[Interval, Array, float, int] | None:
    """Boxes of the slices, shape (m, nv), their middles and half width along the line [m], and the end's index.

    They extend from the plane to the end, which is in the middle of its slice, and beyond as far as time allows.
    """
    numbers, count, (end, other) = leg.policy, max(round(abs(plane) / leg.policy.slice), 1), ends
    half = abs(plane) / (2 * count + 1)
    step = float(np.copysign(2 * half, plane))
    ahead, behind = [end.centre], [end.centre]
    while len(ahead) <= count:
        following = _slid(leg, line, len(ahead) * step, ahead[-1])
        if following is None:
            return None
        ahead.append(following)
    wide = 2 * numbers.line_margin
    while _time(leg, (end, Interval(behind[-1] - wide, behind[-1] + wide), other)) <= longest:
        following = _slid(leg, line, -len(behind) * step, behind[-1])
        if following is None or len(behind) > numbers.most_slices:
            return None
        behind.append(following)
    first, q = len(behind) - 1, np.array([*behind[:0:-1], *ahead])
    wide = np.max(np.abs(np.diff(q, axis=0)), axis=0) + end.radius + numbers.line_margin
    return Interval(q - wide, q + wide), np.asarray(step * (np.arange(len(q)) - first)), half, first


def _slid(leg: BoundLeg, line: BoundRegion, along: float, q: Array) -> Array | None:
    """Joint positions near q with the frame at a distance along the line's free axis [m]; None if not found."""
    at = line.goal.pose * pin.SE3(np.eye(3), along * np.eye(3)[expect(line.free, int, "line")])
    return slid(leg.dynamics.robot, GoalPose(line.goal.frame, at.homogeneous), q, np.zeros(len(q)), leg.torque)


def _inside(inner: Interval, outer: Interval) -> bool:
    return bool(np.all(inner.lower > outer.lower) and np.all(inner.upper < outer.upper))
