"""Boxes of all joint positions that a frame may have on a line that it follows from a known end.

The line is cut into slices. A box around the joint positions of a slice, wide beside them, is narrowed by the
equations of line and slice. If what is left lies inside of the box, no motion leaves the box within the slice: at its
face the frame would be off the line. Where two slices meet, what either holds of the plane between them lies in the
box of the other, so that a motion that begins in one of the boxes is in the box of the slice in which its frame is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armdyn.arguments import expect
from armdyn.models.scene.reaching import GoalPose, slid
from armdyn.optimal.bound.enclosure.interval import Interval, down
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.region import BoundRegion

Array = NDArray[np.float64]

_SLACK = 1e-6
"""Share of a slice by which neighbours overlap, whatever rounding makes of their faces."""


@dataclass(frozen=True, eq=False)
class Tube:
    """Boxes of joint positions along a line, from a known end to a plane across it.

    Attributes:
        box: of all positions before the frame first meets the plane, each end of shape (nv,).
        plane: of those in the plane, likewise.
    """

    box: Interval
    plane: Interval


def tube(leg: BoundLeg, line: BoundRegion, plane: float, end: LegEnd, longest: float) -> Tube | None:
    """The tube of a line; None: it cannot be told from other joint positions.

    Args:
        leg: its velocity limits and its policy.
        line: region with one free axis.
        plane: where the plane lies along that axis [m]; the frame rests at 0.
        end: where it rests.
        longest: no motion between the end and the plane takes longer [s].
    """
    slices = _slices(leg, line, plane, end.q, longest)
    if slices is None:
        return None
    boxes, middles, half, first = slices
    numbers, beside = leg.policy, half * _SLACK
    inner = line.narrowed(boxes, numbers, Interval(middles - half - beside, middles + half + beside))
    if inner is None or not _inside(inner, boxes) or not _inside(end.q[None], boxes[first : first + 1]):
        return None
    edges = (middles[:-1] + middles[1:]) / 2
    for own, other in ((inner[:-1], boxes[1:]), (inner[1:], boxes[:-1])):
        faces = line.narrowed(own, numbers, Interval(edges - beside, edges + beside))
        if faces is None or not _inside(faces, other):
            return None
    if float(np.max(down((inner[0] - end.q).mignitude / leg.velocity))) * 2 < longest:
        return None  # the line may go on behind the slices
    last = line.narrowed(inner[-1:], numbers, Interval(np.array([plane - beside]), np.array([plane + beside])))
    return None if last is None else Tube(_hull(inner[1:]), last[0])


def _slices(
    leg: BoundLeg, line: BoundRegion, plane: float, end: Interval, longest: float
) -> tuple[Interval, Array, float, int] | None:
    """Boxes around the slices, shape (m, nv), their middles along the line and their half width [m], and the end's one.

    They go from the plane to the end, whose slice has it in its middle, and on as far as there is time for.
    """
    numbers, count = leg.policy, max(round(abs(plane) / leg.policy.slice), 1)
    half = abs(plane) / (2 * count + 1)
    step = float(np.copysign(2 * half, plane))
    ahead, behind = [end.centre], [end.centre]
    while len(ahead) <= count:
        following = _slid(leg, line, len(ahead) * step, ahead[-1])
        if following is None:
            return None
        ahead.append(following)
    beside = end.radius + 2 * numbers.beside_line
    while 2 * float(np.max((np.abs(behind[-1] - end.centre) - beside) / leg.velocity)) <= longest:
        following = _slid(leg, line, -len(behind) * step, behind[-1])
        if following is None or len(behind) > numbers.most_slices:
            return None
        behind.append(following)
    first, q = len(behind) - 1, np.array([*behind[:0:-1], *ahead])
    wide = np.max(np.abs(np.diff(q, axis=0)), axis=0) + end.radius + numbers.beside_line
    return Interval(q - wide, q + wide), np.asarray(step * (np.arange(len(q)) - first)), half, first


def _slid(leg: BoundLeg, line: BoundRegion, along: float, q: Array) -> Array | None:
    """Joint positions near others with the frame on the line, so far along its free axis [m]; None: there are none."""
    at = line.goal.pose * pin.SE3(np.eye(3), along * np.eye(3)[expect(line.free, int, "line")])
    return slid(leg.dynamics.robot, GoalPose(line.goal.frame, at.homogeneous), q, np.zeros(len(q)), leg.torque)


def _inside(inner: Interval, outer: Interval) -> bool:
    return bool(np.all(inner.lower > outer.lower) and np.all(inner.upper < outer.upper))


def _hull(boxes: Interval) -> Interval:
    return Interval(np.min(boxes.lower, axis=0), np.max(boxes.upper, axis=0))
