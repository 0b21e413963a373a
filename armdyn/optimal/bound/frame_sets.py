"""Sets of joint positions that bring a frame to a pose or into a region, enclosed by boxes.

A frame is at its goal if the chain of joints closes: with the chain cut at a joint between, R_A, p_A the placement of
that joint in the world, R_B, p_B the frame's in it, and R, p the goal's,

    R_Aᵀ (p − p_A) = p_B    and, with an orientation,    R_A = R R_Bᵀ,

or R_Aᵀ R e = R_B e where the frame may turn about its axis e. In a region around the goal, p is off by at most the
length of its largest deviations, and a direction by its angle; the equations may be violated by as much. No term has
joints of both halves, so that affine forms have only a small part of the second-order terms of the whole chain. Full
poses have further equations, of a few joints each: squared distances between joints' origins. Over a box every equation
is c + Σ s_k ε_k ± r = 0; combinations of them, such as those that solve for one joint, narrow or empty the box (R. E.
Moore, R. B. Kearfott, M. J. Cloud, Introduction to Interval Analysis, 2009, chapter 8). By branch
and prune, a box that is neither empty nor small is bisected.

A region that a motion passes, or a line along which it stays, is enclosed by the deviations of the frame themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import StopCondition
from armdyn.arrays import Array, Flags
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once, cached_property
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.reaching import REACHED, GoalPose, moving_directions
from armdyn.optimal.bound.enclosure import ROUNDED, TURN, Affine, EnclosedFunction, Interval, down, joined, rounding, up
from armdyn.optimal.bound.leg import LegEnd, least_time
from armdyn.optimal.problem.checks import ROUNDING
from armdyn.optimal.problem.policy.bound import BoundPolicy

TOLERANCE = 10 * REACHED
"""Tolerance of every equation [m and of a rotation's entries]: inverse kinematics within `REACHED` are in the set,
whatever the lever between the cut and the frame (below 9 m)."""


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
        # Arms often reach a pose at half a turn, which would lie on both sides of a cut there.
        middle = (ends[0] if ends else np.zeros(self.dynamics.nv)) + 2 * self.policy.sizes[0]
        lower = np.where(self.turning, down(middle - np.pi), box.lower)
        upper = np.where(self.turning, up(middle + np.pi), box.upper)
        return Interval(lower[None], upper[None]) if np.all(np.isfinite(upper - lower)) else None

    def turned(self, boxes: Interval) -> list[tuple[Interval, Array]]:
        """Boxes, shape (boxes, nv), shifted by all whole turns within limits and time, and these turns, shape (nv,)."""
        inside, count = self.within.box, boxes.lower.shape[1]
        found = [(boxes, np.zeros(count))]
        around = boxes.around
        for joint in np.flatnonzero(self.turning & np.isfinite(self.within.velocity)):
            least = int(np.ceil((inside.lower[joint] - around.upper[joint]) / (2 * np.pi) - ROUNDING))
            most = int(np.floor((inside.upper[joint] - around.lower[joint]) / (2 * np.pi) + ROUNDING))
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
        """Narrow and bisect boxes until small; together they enclose the goal set within the given ones, up to turns.

        Args:
            boxes: boxes to examine, shape (boxes, nv).
            small: boxes in which no joint moves the frame by more than this [m, or rad of its orientation] are not
                bisected.
            stop: stopping condition, polled regularly; once true, unexamined boxes are kept.

        Returns:
            Boxes, shape (boxes, nv), possibly none.
        """
        equations, levers, examined = closure(self.dynamics, self.goal), self.levers, 0
        kept: list[Interval] = [boxes[:0]]
        while len(boxes.lower) and examined < self.policy.most_boxes and not stop():
            order = np.argsort(self.within.times(boxes, self.turning), kind="stable")
            batch, later = boxes[order[: self.policy.few]], boxes[order[self.policy.few :]]
            examined += len(batch.lower)
            forms = self._widened(equations.forms(batch.transposed((1, 0))))
            batch, left = narrowed(batch, forms, self.policy)  # left: their indices in `forms`
            near = self.within.times(batch, self.turning) < self.within.duration
            batch, left = batch[near], left[near]
            reach = (batch.upper - batch.lower) * levers
            widest = np.max(reach, axis=1, initial=0.0)
            wide = widest > small
            # Bisect, among the wide joints, the one with the largest part in some equation's range.
            shares = np.max(np.abs(forms.gradient[..., left]) / (forms.far[:, None, left] + TOLERANCE), axis=0).T
            cut = (reach >= self.policy.cut * widest[:, None]) * (shares + TOLERANCE) * (batch.upper - batch.lower)
            kept.append(batch[~wide])
            boxes = joined([later, *_halves(batch[wide], np.argmax(cut[wide], axis=1))])
        return joined([*kept, boxes])

    def shrunk(self, boxes: Interval, stop: StopCondition) -> Interval:
        """Shrink touching boxes, shape (boxes, nv), to almost a point if they enclose an isolated joint position."""
        few = replace(self, policy=replace(self.policy, most_boxes=self.policy.few))
        tiny = boxes if self.continuous else few.enclosed(boxes.around[None], self.policy.tiny, stop)
        small = len(tiny.lower) == 0 or np.max(tiny.around.radius) < self.policy.tiny
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


def narrowed(boxes: Interval, forms: Affine, numbers: BoundPolicy) -> tuple[Interval, NDArray[np.intp]]:
    """Narrow boxes to where equations may hold; return them and their indices, without the emptied ones.

    Args:
        boxes: shape (boxes, nv).
        forms: equations in ε of `EnclosedFunction.forms`: zero within `TOLERANCE`.
        numbers: settings of the narrowing.
    """
    left = np.flatnonzero(np.all(np.abs(forms.centre) <= (forms.far + TOLERANCE) * (1 + ROUNDED), axis=0))
    boxes, forms = boxes[left], Affine(*(part[..., left] for part in forms.parts))
    centre, gradient = forms.centre.T, np.ascontiguousarray(forms.gradient.transpose(2, 0, 1))
    rest, (m, nv) = forms.rest.T + TOLERANCE, gradient.shape[1:]
    normal = gradient @ gradient.transpose(0, 2, 1)
    damping = numbers.tiny * np.trace(normal, axis1=1, axis2=2) + 1e-30
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
        away = ROUNDED * (1 + np.maximum(np.abs(first), np.abs(last)))  # for the rounding of sum and quotient
        first, last = np.where(sign > 0, first, last) - away, np.where(sign > 0, last, first) + away
        lower = np.maximum(lower, np.max(np.where(sign == 0, -1.0, first), axis=1))
        upper = np.minimum(upper, np.min(np.where(sign == 0, 1.0, last), axis=1))
        possible &= ~np.any(lower > upper, axis=1)
        lower, upper = np.minimum(lower, 1.0), np.maximum(upper, -1.0)
    middle, radius = boxes.centre, boxes.radius
    error = rounding(8, np.abs(middle) + radius)
    inner = Interval(middle + radius * lower - error, middle + radius * upper + error)
    return boxes.meet(inner)[possible], left[possible]


def chain_to(robot: Robot, goal: GoalPose) -> list[int]:
    """Joints between the world and the frame, in order."""
    return list(robot.model.supports[robot.frame(goal.frame).parentJoint])[1:]


@built_once(maxsize=16)
def closure(dynamics: Dynamics, goal: GoalPose) -> EnclosedFunction:
    """Equations of q that are zero exactly where the frame is at its goal."""
    q, chain = ca.SX.sym("q", dynamics.nv), chain_to(dynamics.robot, goal)
    # By experiment on UR5 and Panda: a cut in the middle, one joint later with an orientation, needs fewest boxes.
    own = chain[: min(len(chain) // 2 + goal.oriented, len(chain) - 1)]
    if own:
        at = slice(4 * (own[-1] - 1), 4 * own[-1])
        inner = dynamics.placements(q)[:, at]
        outer_q = _behind(q, own)
        fixed = dynamics.placements(np.zeros(dynamics.nv))[:, at]
    else:
        inner, outer_q, fixed = ca.horzcat(ca.SX.eye(3), ca.SX.zeros(3)), q, np.eye(3, 4)
    rotation, origin = dynamics.frame_placement(outer_q, goal.frame)
    back = ca.SX(fixed[:, :3].T.copy())
    rotation, origin = back @ rotation, back @ (origin - fixed[:, 3])
    rows = [inner[:, :3].T @ (goal.pose.translation - inner[:, 3]) - origin]
    if goal.axis is not None:
        axis = ca.SX.eye(3)[:, goal.axis]
        rows.append(inner[:, :3].T @ (ca.SX(goal.pose.rotation.copy()) @ axis) - rotation @ axis)
    elif goal.oriented:
        rows.append(ca.vec(inner[:, :3] - ca.SX(goal.pose.rotation.copy()) @ rotation.T))
    if goal.exact and goal.oriented:
        rows += _distances(dynamics, goal, q)
    return EnclosedFunction.of(ca.Function("closure", [q], [ca.cse(ca.densify(ca.vertcat(*rows)))]))


def _distances(dynamics: Dynamics, goal: GoalPose, q: ca.SX) -> list[ca.SX]:
    """Equations of a few joints each: squared distances between two joints' origins [m²].

    The distances follow from the joints between these two, and from the other joints, through the world and the goal.
    Joints that turn about either origin have no effect.
    """
    n, chain, rng = dynamics.nv, chain_to(dynamics.robot, goal), np.random.default_rng(0)
    # A polynomial of sines and cosines, of second degree in each joint's, that is not zero identically vanishes at
    # random positions with probability zero: one for each joint is more than enough.
    samples, found = rng.uniform(-np.pi, np.pi, (n, n)), []
    for i, j in combinations(range(len(chain)), 2):
        first, last = 4 * (chain[i] - 1), 4 * (chain[j] - 1)
        between = dynamics.placements(_behind(q, chain[: i + 1]))
        inner = between[:, last + 3] - between[:, first + 3]
        fixed = dynamics.placements(np.zeros(n))[:, last : last + 4]
        rotation, origin = dynamics.frame_placement(_behind(q, chain[: j + 1]), goal.frame)
        back = ca.SX(goal.pose.rotation.copy()) @ rotation.T
        outer = goal.pose.translation - back @ (origin - fixed[:, 3]) - dynamics.placements(q)[:, first + 3]
        row = ca.sumsqr(inner) - ca.sumsqr(outer)
        gradient = ca.Function("gradient", [q], [ca.jacobian(row, q)])
        sizes = [np.abs(gradient(one).full()[0]) for one in samples]
        idle = [int(k) + 1 for k in np.flatnonzero(np.max(sizes, axis=0) < ROUNDED)]
        found.append((n - len(idle), ca.substitute(row, q, _behind(q, idle))))
    return [row for count, row in found if 0 < count <= n - 2]


def _behind(q: ca.SX, joints: Sequence[int]) -> ca.SX:
    """Joint positions with zeros for some joints."""
    return ca.vertcat(*(0.0 if k + 1 in joints else q[k] for k in range(q.numel())))


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
        forms, most = function.forms(boxes.transposed((1, 0))), self.goal.deviations.copy()
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
        for _ in range(policy.narrowings + 1 if rounds is None else rounds):
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
