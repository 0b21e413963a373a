"""Boxes that enclose all joint positions that bring a frame to a pose, by interval branch and prune.

A frame is at its goal if the chain of joints closes: with the chain cut at a joint between, R_A, p_A the placement of
that joint in the world, R_B, p_B the frame's in it, and R, p the goal's,

    R_Aᵀ (p − p_A) = p_B    and, with an orientation,    R_A = R R_Bᵀ,

or R_Aᵀ R e = R_B e where the frame may turn about its axis e. In a region around the goal, p is off by at most the
length of its largest deviations, and a direction by its angle; the equations may be violated by as much. No term has
joints of both halves, so that affine forms have only a small part of the second-order terms of the whole chain. Full
poses have further equations, of a few joints each: squared distances between joints' origins. Over a box every equation
is c + Σ s_k ε_k ± r = 0; combinations of them, such as those that solve for one joint, narrow or empty the box (R. E.
Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis, 2009, chapter 8). A box that is neither empty nor
small is bisected.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import StopCondition
from armdyn.arrays import Array, Flags
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import cached_property
from armdyn.models.scene.reaching import REACHED, GoalPose
from armdyn.optimal.bound.closure import chain_to, closure
from armdyn.optimal.bound.enclosure import Affine
from armdyn.optimal.bound.interval import TURN, Interval, down, joined, rounding, up
from armdyn.optimal.bound.reach import least_time
from armdyn.optimal.problem.policy.bound import BoundPolicy

TOLERANCE = 10 * REACHED
"""Tolerance of every equation [m and of a rotation's entries]: inverse kinematics within `REACHED` are in the set,
whatever the lever between the cut and the frame (below 9 m)."""

_NEAR = 1e-9
"""Share of a turn by which limits may admit a further turn, to cover rounding."""

_SEAM = 0.1
"""Offset of the cut of a joint's circle from half a turn off the middle [rad]: arms often reach a pose at half a turn,
which would lie on both sides of the cut."""

_BATCH = 500
"""Number of boxes that are evaluated at once: arrays of some 10 MB."""


@dataclass(frozen=True, eq=False)
class Within:
    """Joint positions that a motion between given ones may pass within the velocity limits and a duration.

    Attributes:
        ends: joint positions before and after [rad or m], each of shape (nv,); empty: all within limits.
        velocity: velocity limits [rad/s or m/s], shape (nv,); infinite: no limit.
        position: position limits [rad or m], each end of shape (nv,).
        duration: duration of the motion [s].
    """

    ends: tuple[Array, ...]
    velocity: Array
    position: Interval
    duration: float

    @property
    def box(self) -> Interval:
        """Box of all these positions, each end of shape (nv,), possibly infinite."""
        box = self.position
        finite = np.isfinite(self.velocity)
        far = np.where(finite, up(np.where(finite, self.velocity, 1.0) * self.duration), np.inf)
        for q in self.ends:
            box = box.intersection(Interval.at(q) + Interval(-far, far))
        return box

    def times(self, boxes: Interval, turning: Flags) -> Array:
        """Time from end to end through each box by the velocity limits [s], rounded down, shape (boxes,).

        Args:
            boxes: shape (boxes, nv).
            turning: whether a joint's positions are meant modulo 2π, shape (nv,).
        """
        total = np.zeros(len(boxes.lower))
        for q in self.ends:
            total = total + least_time(Interval.at(q), boxes, self.velocity, turning)
        return np.maximum(down(total), 0.0)


@dataclass(frozen=True, eq=False)
class GoalSet:
    """Set of the joint positions within limits that bring a frame to a pose and that motions may pass in time.

    Attributes:
        dynamics: dynamics of the arm.
        goal: goal pose of a frame.
        within: positions that motions may pass.
        policy: tuned numbers of the bound.
    """

    dynamics: Dynamics
    goal: GoalPose
    within: Within
    policy: BoundPolicy

    @cached_property
    def levers(self) -> Array:
        """Approximate distance by which each joint moves the frame [m/rad or 1] or turns it [1], shape (nv,)."""
        robot, levers = self.dynamics.robot, np.zeros(self.dynamics.nv)
        beyond, offset = float(self.goal.oriented), robot.frame(self.goal.frame).placement.translation
        for joint in reversed(chain_to(robot, self.goal)):
            axis = np.ravel(robot.model.joints[joint].createData().S)
            levers[joint - 1] = 1.0 if np.any(axis[:3]) else beyond + np.linalg.norm(np.cross(axis[3:], offset))
            beyond, offset = beyond + float(np.linalg.norm(offset)), robot.model.jointPlacements[joint].translation
        return levers

    def before(self, duration: float) -> GoalSet:
        """The part of the set that motions within a duration [s] may reach."""
        return replace(self, within=replace(self.within, duration=duration))

    @property
    def continuous(self) -> bool:
        """Whether the set is a continuum rather than isolated joint positions."""
        return any(self.goal.tolerance) or self.dynamics.nv > np.sum(np.isfinite(self.goal.deviations))

    @cached_property
    def turning(self) -> Flags:
        """Whether each joint may turn by more than 2π, so that the set repeats after a turn, shape (nv,)."""
        box = self.within.box
        return ~self.dynamics.robot.slides & (box.upper - box.lower > 2 * np.pi)

    @property
    def whole(self) -> Interval | None:
        """One box, shape (1, nv), that encloses the set up to whole turns.

        None if the set is not bounded, or no equations enclose it.
        """
        box, ends = self.within.box, self.within.ends
        if not is_closed(self.goal):
            return None
        if np.any(np.isinf((box.upper - box.lower)[self.turning & np.isfinite(self.within.velocity)])):
            return None  # unbounded number of turns
        middle = (ends[0] if ends else np.zeros(self.dynamics.nv)) + _SEAM
        lower = np.where(self.turning, down(middle - np.pi), box.lower)
        upper = np.where(self.turning, up(middle + np.pi), box.upper)
        return Interval(lower[None], upper[None]) if np.all(np.isfinite(upper - lower)) else None

    def turned(self, boxes: Interval) -> list[tuple[Interval, Array]]:
        """Boxes, shape (boxes, nv), shifted by all whole turns within limits and time, and these turns, shape (nv,)."""
        inside, count = self.within.box, boxes.lower.shape[1]
        found = [(boxes, np.zeros(count))]
        around = boxes.around
        for joint in np.flatnonzero(self.turning & np.isfinite(self.within.velocity)):
            least = int(np.ceil((inside.lower[joint] - around.upper[joint]) / (2 * np.pi) - _NEAR))
            most = int(np.floor((inside.upper[joint] - around.lower[joint]) / (2 * np.pi) + _NEAR))
            unit = np.eye(count)[joint]
            by = [(k * unit, Interval.at(float(k)) * TURN) for k in range(least, most + 1)]
            found = [
                (one + Interval(turn.lower * unit, turn.upper * unit) if np.any(k) else one, turns + k)
                for one, turns in found
                for k, turn in by
            ]
        none = np.zeros_like(self.turning)
        return [(one, turns) for one, turns in found if np.any(self.within.times(one, none) < self.within.duration)]

    def enclosed(self, boxes: Interval, small: float, stop: StopCondition) -> Interval:
        """Boxes that enclose the part of the goal set within given boxes, up to whole turns of joints.

        Args:
            boxes: boxes that enclose it, shape (boxes, nv).
            small: boxes in which no joint moves the frame by more than this [m, or rad of its orientation] are not
                bisected.
            stop: stopping condition, polled regularly; once true, unexamined boxes are kept.

        Returns:
            Boxes, shape (boxes, nv), possibly none.
        """
        closing, levers, examined = closure(self.dynamics, self.goal), self.levers, 0
        kept: list[Interval] = [boxes[:0]]
        while len(boxes.lower) and examined < self.policy.most_boxes and not stop():
            order = np.argsort(self.within.times(boxes, self.turning), kind="stable")
            now, later = boxes[order[:_BATCH]], boxes[order[_BATCH:]]
            examined += len(now.lower)
            forms = self._widened(closing.forms(now.turned((1, 0))))
            now, left = narrowed(now, forms, self.policy)
            near = self.within.times(now, self.turning) < self.within.duration
            now, left = now[near], left[near]
            reach = (now.upper - now.lower) * levers
            widest = np.max(reach, axis=1, initial=0.0)
            wide = widest > small
            # Bisect, among the wide joints, the one with the largest part in some equation's range.
            shares = np.max(np.abs(forms.gradient[..., left]) / (forms.far[:, None, left] + TOLERANCE), axis=0).T
            cut = (reach >= self.policy.cut * widest[:, None]) * (shares + TOLERANCE) * (now.upper - now.lower)
            kept.append(now[~wide])
            boxes = joined([later, *_halves(now[wide], np.argmax(cut[wide], axis=1))])
        return joined([*kept, boxes])

    def shrunk(self, boxes: Interval, stop: StopCondition) -> Interval:
        """Shrink touching boxes, shape (boxes, nv), to almost a point if they enclose an isolated joint position."""
        few = replace(self, policy=replace(self.policy, most_boxes=self.policy.few))
        tiny = boxes if self.continuous else few.enclosed(boxes.around[None], self.policy.isolated, stop)
        small = len(tiny.lower) == 0 or np.max(tiny.around.radius) < self.policy.isolated
        return boxes if self.continuous or not small else tiny.around[None] if len(tiny.lower) else tiny

    def cut(self, boxes: Interval) -> list[Interval]:
        """Split boxes, shape (boxes, nv), into two groups along the joint in which they move the frame most."""
        around = boxes.around
        joint = int(np.argmax((around.upper - around.lower) * self.levers))
        along = boxes.centre[:, joint]
        beyond = along > (around.lower[joint] + around.upper[joint]) / 2
        if np.all(beyond == beyond[0]):  # nearly nested boxes: split them anyway
            beyond = np.argsort(np.argsort(along)) >= len(along) / 2
        return [part for part in (boxes[~beyond], boxes[beyond]) if len(part.lower)]

    def closure_over(self, box: Interval) -> Affine:
        """The equations over one box, shape (nv,), as affine forms that contain zero where the frame is at its goal."""
        forms = self._widened(closure(self.dynamics, self.goal).forms(box[:, None]))
        own = 3 if not self.goal.oriented else 12 if self.goal.axis is None else 6  # distances are redundant then
        return Affine(forms.centre[:own], forms.gradient[:own], forms.rest[:own] + TOLERANCE)

    def _widened(self, forms: Affine) -> Affine:
        """Closure equations whose remainder includes the goal's tolerances, so that they hold in all of its region."""
        if self.goal.exact:
            return forms
        most = self.goal.deviations
        sizes = np.linalg.norm(most[:3]), np.linalg.norm(most[3:][np.isfinite(most[3:])])
        by = np.where(np.arange(len(forms.rest)) < 3, *sizes)
        return Affine(forms.centre, forms.gradient, forms.rest + by.reshape(-1, *(1,) * (forms.rest.ndim - 1)))


def narrowed(boxes: Interval, forms: Affine, numbers: BoundPolicy) -> tuple[Interval, NDArray[np.intp]]:
    """Narrow boxes to where equations may hold; return them and their indices, without the emptied ones.

    Args:
        boxes: shape (boxes, nv).
        forms: equations in ε of `EnclosedFunction.forms`: zero within `TOLERANCE`.
        numbers: settings of the narrowing.
    """
    left = np.flatnonzero(np.all(np.abs(forms.centre) <= (forms.far + TOLERANCE) * (1 + 1e-12), axis=0))
    boxes, forms = boxes[left], Affine(*(part[..., left] for part in forms.parts))
    centre, gradient = forms.centre.T, np.ascontiguousarray(forms.gradient.transpose(2, 0, 1))
    rest, (m, nv) = forms.rest.T + TOLERANCE, gradient.shape[1:]
    normal = gradient @ gradient.transpose(0, 2, 1)
    damping = numbers.damping * np.trace(normal, axis1=1, axis2=2) + 1e-30
    solved = np.linalg.solve(
        normal + damping[:, None, None] * np.eye(m), np.concatenate([gradient, centre[..., None]], 2)
    )
    # Any combinations are valid: per joint the one that solves for it, then that of the error, then single rows.
    w = np.concatenate([solved.transpose(0, 2, 1), np.broadcast_to(np.eye(m), (len(centre), m, m))], axis=1)
    sizes = np.abs(centre) + np.sum(np.abs(gradient), axis=2) + rest
    value, row, remainder = (w @ centre[..., None])[..., 0], w @ gradient, (np.abs(w) @ rest[..., None])[..., 0]
    remainder = remainder + rounding(2 * (m + nv), (np.abs(w) @ sizes[..., None])[..., 0])
    lower, upper = -np.ones((len(centre), nv)), np.ones((len(centre), nv))
    possible, sign = np.ones(len(centre), dtype=bool), np.sign(row)
    safe = np.where(row == 0, 1.0, row)
    for _ in range(numbers.narrowings):
        ends = row * lower[:, None], row * upper[:, None]
        least, most = np.minimum(*ends), np.maximum(*ends)
        low = (-value - remainder - np.sum(most, axis=2))[..., None]
        high = (remainder - value - np.sum(least, axis=2))[..., None]
        possible &= ~np.any((low > 0) | (high < 0), axis=(1, 2))
        first, last = (low + most) / safe, (high + least) / safe
        away = 1e-12 * (1 + np.maximum(np.abs(first), np.abs(last)))  # for the rounding of sum and quotient
        first, last = np.where(sign > 0, first, last) - away, np.where(sign > 0, last, first) + away
        lower = np.maximum(lower, np.max(np.where(sign == 0, -1.0, first), axis=1))
        upper = np.minimum(upper, np.min(np.where(sign == 0, 1.0, last), axis=1))
        possible &= ~np.any(lower > upper, axis=1)
        lower, upper = np.minimum(lower, 1.0), np.maximum(upper, -1.0)
    middle, radius = boxes.centre, boxes.radius
    error = rounding(8, np.abs(middle) + radius)
    inner = Interval(middle + radius * lower - error, middle + radius * upper + error)
    return boxes.meet(inner)[possible], left[possible]


def clusters(boxes: Interval, stop: StopCondition) -> list[Interval]:
    """Groups of touching boxes, shape (boxes, nv), with disjoint hulls; a single group when stopped.

    Thousands of boxes take seconds.
    """
    groups: list[tuple[Array, Array, list[int]]] = []
    for k, (lower, upper) in enumerate(zip(boxes.lower, boxes.upper, strict=True)):
        if stop():
            return [boxes]
        members, apart = [k], []
        for first, last, others in groups:
            if np.all((first <= upper) & (lower <= last)):
                lower, upper, members = np.minimum(lower, first), np.maximum(upper, last), members + others
            else:
                apart.append((first, last, others))
        groups = [*apart, (lower, upper, members)]
    return [boxes[np.array(members)] for _, _, members in groups]


def is_closed(goal: GoalPose) -> bool:
    """Whether equations enclose the joint positions that reach a goal: not if its position is free along an axis."""
    return bool(np.all(np.isfinite(goal.deviations[:3])))


def _halves(boxes: Interval, joint: NDArray[np.intp]) -> tuple[Interval, Interval]:
    """Boxes, each bisected along one joint."""
    cut = np.arange(boxes.lower.shape[1]) == joint[:, None]
    middle = boxes.centre
    return Interval(boxes.lower, np.where(cut, middle, boxes.upper)), Interval(
        np.where(cut, middle, boxes.lower), boxes.upper
    )
