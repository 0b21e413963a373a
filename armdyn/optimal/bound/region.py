"""Regions of a frame: their deviations enclosed over boxes, and all joint positions along a line from a known end.

The line is divided into slices. A box around the joint positions of a slice, with a wide margin, is narrowed by the
equations of line and slice. If the result lies inside the box, no motion leaves the box within the slice: at the box's
face the frame would be off the line. The parts of two adjacent boxes in the plane between the slices lie in each
other's box, so that a motion that begins in one of the boxes is in the box of its frame's slice, as long as it does not
leave the slices.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as ca
import numpy as np
import pinocchio as pin

from armdyn.arguments import expect
from armdyn.arrays import Array, Flags
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.models.scene.reaching import GoalPose, moving_directions, slid
from armdyn.optimal.bound.enclosure import Affine, EnclosedFunction
from armdyn.optimal.bound.goal_set import TOLERANCE, narrowed
from armdyn.optimal.bound.interval import Interval, sum_down
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.reach import least_time
from armdyn.optimal.problem.policy.bound import BoundPolicy


@dataclass(frozen=True)
class BoundRegion:
    """Region of a frame, for bounds: encloses all joint positions within it.

    Attributes:
        dynamics: dynamics of the arm.
        goal: the region.
    """

    dynamics: Dynamics
    goal: GoalPose

    @property
    def free(self) -> int | None:
        """Index of the one axis along which the frame moves freely; None: no such axis, or several."""
        axes = np.flatnonzero(np.isinf(self.goal.deviations[:3]))
        return int(axes[0]) if axes.size == 1 else None

    def forms(self, boxes: Interval, along: Interval | None = None) -> Affine:
        """Affine forms over boxes, shape (boxes, nv), that contain zero where the frame is in the region.

        With Δ = log(Rᵀ R_frame) the deviation's rotation vector, the antisymmetric part of Rᵀ R_frame is
        Δ sin |Δ| / |Δ|, no component of which is larger than that of Δ.

        Args:
            boxes: boxes of joint positions [rad or m].
            along: position of the frame along its free axis in each box [m], shape (boxes,); None: any.

        Returns:
            Shape (m, boxes).
        """
        function, moving = _deviations(self.dynamics, self.goal)
        forms, most = function.forms(boxes.turned((1, 0))), self.goal.deviations.copy()
        if self.goal.axis is not None:
            most[3:] = np.inf  # deviations of a free axis are defined differently
        limit = np.repeat(most[:, None], len(boxes.lower), axis=1)
        middle = np.zeros_like(limit)
        if along is not None and self.free is not None:
            middle[self.free], limit[self.free] = along.centre, along.radius
        own = np.flatnonzero(moving & np.isfinite(limit[:, 0]))
        centre = Affine(middle, np.zeros_like(forms.gradient), limit + TOLERANCE)
        return Affine(*(part[own] for part in (forms - centre).parts))

    def narrowed(
        self, boxes: Interval, policy: BoundPolicy, along: Interval | None = None, rounds: int | None = None
    ) -> Interval | None:
        """Boxes narrowed to the frame in the region, shape (boxes, nv); None: impossible in some box."""
        for _ in range(policy.region_rounds if rounds is None else rounds):
            found = narrowed(boxes, self.forms(boxes, along), policy)[0]
            if len(found.lower) < len(boxes.lower):
                return None
            boxes = found
        return boxes

    def end(self, box: Interval) -> LegEnd:
        """The region within a box, shape (nv,), passed at any velocity."""
        return LegEnd(box, None, self.forms(box[None]))


@built_once(maxsize=32)
def _deviations(dynamics: Dynamics, goal: GoalPose) -> tuple[EnclosedFunction, Flags]:
    """Deviations along and about x, y, z [m and of a rotation's entries], and whether the frame moves in each."""
    q = ca.SX.sym("q", dynamics.nv)
    rotation, origin = dynamics.frame_placement(q, goal.frame)
    back = ca.SX(goal.pose.rotation.T.copy())
    turned = back @ rotation
    turns = ca.vertcat(turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1])
    expression = ca.cse(ca.densify(ca.vertcat(back @ (origin - goal.pose.translation), 0.5 * turns)))
    return EnclosedFunction.of(ca.Function("deviations", [q], [expression])), moving_directions(dynamics.robot, goal)


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
