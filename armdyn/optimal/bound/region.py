"""Deviations of a frame from the region of a goal pose, enclosed over boxes of joint positions."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.arrays import Flags
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.models.scene.reaching import GoalPose, moving_directions
from armdyn.optimal.bound.enclosure import Affine, EnclosedFunction
from armdyn.optimal.bound.goal_set import TOLERANCE, narrowed
from armdyn.optimal.bound.interval import Interval
from armdyn.optimal.bound.leg import LegEnd
from armdyn.optimal.task.policy.bound import BoundPolicy


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
