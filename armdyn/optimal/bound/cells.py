"""Cells of time, each with boxes that enclose the reachable positions and velocities.

Time is divided into cells of fixed lengths, whose sum is at most any motion's duration, and elastic cells, which take
the rest. A leg by itself has short cells from the start on, one elastic cell in the middle, and cells to the goal. A
leg through regions has an elastic cell between any two of them. Motions of any duration have this shape, whenever they
pass the regions, so that one proof covers all durations.

If a motion begins and ends with zero acceleration under a jerk limit, an acceleration is at most the jerk limit times
the time to the nearer end. Likewise torques stay near the holding torques at the ends.

For any multipliers w, constant in time, wᵀM(q) v = wᵀp, and the change of wᵀp since the start is bounded by its rate.
The velocity of joint b is therefore, with its unit vector e_b,

    v_b(t) = wᵀp(t) + (e_b − M(q) w)ᵀ v(t),

and every w gives a bound. The w tried here solve M_FF w_F = e_b for sets F of free joints, with all others at any speed
up to their limits: F is the slowest joint alone, the two slowest, and so on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import StopCondition
from armdyn.arrays import Array, Flags
from armdyn.optimal.bound.enclosure import ROUNDED, Affine, Interval, joined, stacked, terms_over, up
from armdyn.optimal.bound.frame_sets import BoundRegion
from armdyn.optimal.bound.leg import BoundLeg, Forces, LegEnd
from armdyn.optimal.problem.checks import ROUNDING
from armdyn.optimal.problem.policy.bound import BoundPolicy


@dataclass(frozen=True, eq=False)
class Phase:
    """Part of a motion between two regions that it passes.

    Attributes:
        least: lower bound on the time of the phase [s].
        box: box of all joint positions in the phase [rad or m], each end of shape (nv,).
        line: region in which the frame stays during the phase; None: no such region.
        goal: region at the end of the phase, and the box of joint positions there; None: the leg's goal.
    """

    least: float
    box: Interval
    line: BoundRegion | None = None
    goal: tuple[BoundRegion, Interval] | None = None


@dataclass(frozen=True, eq=False)
class Cells:
    """Cells of time in order, and the known positions at the nodes between them.

    Attributes:
        lengths: lengths of the cells [s], shape (n,); 0 for elastic cells.
        longest: duration up to which motions are covered [s].
        lines: region in which the frame stays during each cell; None: no such region.
        passed: region of the frame at a node, by the node's index; not for the first and the last node.
        q: positions in the cells [rad or m], shape (n, nv).
        nodes: positions at the nodes, shape (n + 1, nv).
        v: velocities in the cells [rad/s or m/s], shape (n, nv).
    """

    lengths: Array
    longest: float
    lines: tuple[BoundRegion | None, ...]
    passed: dict[int, BoundRegion]
    q: Interval
    nodes: Interval
    v: Interval

    @classmethod
    def of(cls, leg: BoundLeg, half: float, longest: float) -> Cells | None:
        """Cells of a leg by itself, within limits; None: no motion is that fast.

        Args:
            leg: leg with its ends.
            half: largest sum of the cells of each side [s]; no motion is faster than twice that.
            longest: duration up to which motions are covered [s].
        """
        side = _side(half, leg.policy)
        return cls._of(leg, [Phase(0.0, leg.position)], [[*side, 0.0, *side[::-1]]], longest)

    @classmethod
    def in_phases(cls, leg: BoundLeg, phases: Sequence[Phase], longest: float) -> Cells | None:
        """Cells of a leg through regions, phase by phase, within limits; None: no motion is that fast."""
        rest = [leg.start.at_rest, *[False] * (len(phases) - 1), leg.goal.at_rest]
        lengths = [_lengths(*each, leg.policy) for each in zip(phases, rest[:-1], rest[1:], strict=True)]
        return cls._of(leg, phases, lengths, longest)

    @classmethod
    def _of(
        cls, leg: BoundLeg, phases: Sequence[Phase], lengths: Sequence[Sequence[float]], longest: float
    ) -> Cells | None:
        """Cells from the phases' lengths, phase by phase."""
        lines, boxes = list[BoundRegion | None](), list[Interval]()
        passed, nodes = dict[int, BoundRegion](), [leg.start.q]
        for phase, own in zip(phases, lengths, strict=True):
            lines += [phase.line] * len(own)
            boxes += [phase.box] * len(own)
            nodes += [phase.box] * (len(own) - 1)
            if phase.goal is not None:
                passed[len(lines)] = phase.goal[0]
            nodes.append(leg.goal.q if phase.goal is None else phase.goal[1])
        most = np.broadcast_to(leg.velocity, (len(lines), len(leg.velocity)))
        every, v = np.concatenate(lengths), Interval(-most, most)
        cells = cls(every, longest, tuple(lines), passed, stacked(boxes, 0), stacked(nodes, 0), v)
        return cells.narrowed(leg, v) if cells.time_left > 0 else None

    @property
    def elastic(self) -> Flags:
        """Whether each cell is elastic, shape (n,)."""
        return np.asarray(self.lengths == 0)

    @property
    def fixed(self) -> NDArray[np.intp]:
        """Indices of the fixed cells."""
        return np.flatnonzero(self.lengths)

    @property
    def node(self) -> NDArray[np.intp]:
        """Index of every node, counting the two ends of an elastic cell once, shape (n + 1,)."""
        return np.concatenate([[0], np.cumsum(~self.elastic)])

    @property
    def time_left(self) -> float:
        """Time that the longest motion has for the elastic cells [s]; not positive: no motion exists."""
        return float((Interval.at(self.longest) - Interval.at(self.lengths).sum(0)).upper)

    @property
    def times(self) -> Interval:
        """Lengths of all cells [s], shape (n,)."""
        return Interval(self.lengths, np.where(self.elastic, self.time_left, self.lengths))

    @property
    def middle(self) -> int:
        """Index of the first elastic cell; the only one of a leg by itself."""
        return int(np.argmax(self.elastic))

    @property
    def side(self) -> Array:
        """Lengths of the cells before the middle [s], shape (k,); for a leg by itself also of those to the goal."""
        return self.lengths[: self.middle]

    def cut(self, leg: BoundLeg, half: float) -> Cells | None:
        """Cells of a leg by itself for another length of its sides, with the known velocity bounds."""
        new = Cells.of(leg, half, self.longest)
        if new is None:
            return None
        old, begin, k = np.cumsum(self.side), np.append(0.0, np.cumsum(new.side)), self.middle
        first = np.searchsorted(old, begin[:-1] * (1 - ROUNDING))
        last = np.minimum(np.searchsorted(old, begin[1:] * (1 + ROUNDING)), k - 1)
        forward = [self.v[a : b + 1].around for a, b in zip(first, last, strict=True)]
        backward = [self.v[2 * k - b : 2 * k - a + 1].around for a, b in zip(first, last, strict=True)]
        return new.narrowed(leg, stacked([*forward, new.v[new.middle], *backward[::-1]], 0))

    def narrowed(self, leg: BoundLeg, v: Interval) -> Cells | None:
        """Cells with further bounds of the velocities, and of the positions that these imply; None: no motion."""
        v = self.v.meet(v)
        ways = self.times[:, None] * v
        nodes = self.nodes.propagated(ways).intersection(self.nodes[::-1].propagated(-ways[::-1])[::-1])
        if np.any(nodes.lower > nodes.upper):
            return None
        for k, region in self.passed.items():
            box = region.narrowed(nodes[k : k + 1], leg.policy, rounds=1)
            if box is None:
                return None
            nodes.lower[k], nodes.upper[k] = box.lower[0], box.upper[0]
        q = self.q
        for ends, way in ((nodes[:-1], ways), (nodes[1:], -ways)):
            q = q.intersection(ends.hull(ends + way))
        if np.any(q.lower > q.upper):
            return None
        for line in {line for line in self.lines if line is not None}:
            own = np.array([k for k, one in enumerate(self.lines) if one == line])
            box = line.narrowed(q[own], leg.policy, rounds=1)
            if box is None:
                return None
            q.lower[own], q.upper[own] = box.lower, box.upper
        inner = nodes[1:-1].intersection(q[:-1].intersection(q[1:]))
        nodes = joined([leg.start.q[None], inner, leg.goal.q[None]])
        return None if np.any(nodes.lower > nodes.upper) else replace(self, q=q, v=v, nodes=nodes)

    def forces(self, leg: BoundLeg) -> Forces:
        """Forces over the cells."""
        return Forces(terms_over(leg.dynamics, self.q), self.v, torques(leg, self), leg.dynamics.robot.friction)

    def ends(self, leg: BoundLeg) -> list[LegEnd | None]:
        """Known positions, or linear forms of them, at all nodes, including the ends; None: unknown."""
        found: list[LegEnd | None] = [leg.start, *[None] * (len(self.lengths) - 1), leg.goal]
        owners = [None, *(self.passed.get(k) or self.lines[k] for k in range(1, len(self.lengths))), None]
        for region in {region for region in owners if region is not None}:
            own = [k for k, one in enumerate(owners) if one == region]
            forms = region.forms(self.nodes[own])
            for i, k in enumerate(own):
                found[k] = LegEnd(self.nodes[k], None, Affine(*(part[..., i : i + 1] for part in forms.parts)))
        return found


def _side(half: float, numbers: BoundPolicy) -> Array:
    """Lengths of the cells of one side [s]; their sum is at most half."""
    lengths: list[float] = []
    length = numbers.shortest
    while sum(lengths) + length < 1:
        lengths.append(length)
        length = min(length * numbers.growth, numbers.longest)
    return np.array(lengths) * (half / sum(lengths) * (1 - ROUNDED))


def _lengths(phase: Phase, from_rest: bool, to_rest: bool, numbers: BoundPolicy) -> list[float]:
    """Lengths of a phase's cells [s]: 0 for the elastic one, which is where the arm rests, else in the middle."""
    if phase.least <= 0:
        return [0.0]
    count = numbers.phase_cells
    if from_rest != to_rest:
        fixed = [phase.least / count * (1 - ROUNDED)] * count
        return [0.0, *fixed] if from_rest else [*fixed, 0.0]
    parts = numbers.growth ** np.arange(count // 2)
    side = (phase.least / (2 * np.sum(parts)) * (1 - ROUNDED) * parts).tolist()
    return [*side, 0.0, *side[::-1]]


def accelerations(leg: BoundLeg, cells: Cells) -> Array:
    """Largest accelerations in every cell [rad/s² or m/s²], shape (n, nv); infinite: no limit."""
    if leg.start.v is None or leg.goal.v is None or cells.passed:  # at a via point any acceleration is allowed
        return np.broadcast_to(leg.acceleration, cells.v.lower.shape)
    since = np.minimum(np.minimum(*_since_ends(cells)), up(np.array(cells.longest / 2)))
    return np.minimum(leg.acceleration, up(since[:, None] * leg.jerk))


def torques(leg: BoundLeg, cells: Cells) -> Interval:
    """Torques in every cell [N m or N], shape (n, nv)."""
    actuators = leg.torque.actuators
    found = Interval(actuators.lower, actuators.upper).spread(cells.v.lower.shape)
    if cells.passed or not np.any(np.isfinite(leg.torque_rate)):
        return found
    for end, since in zip((leg.start, leg.goal), _since_ends(cells), strict=True):
        terms = terms_over(leg.dynamics, end.q[None])
        open_ = up(np.sum(terms.gravity_gradient.magnitude[0], axis=0))
        hold = terms.gravity[0] + Interval(-open_, open_)
        held = (hold.lower >= actuators.lower) & (hold.upper <= actuators.upper)  # else any initial torque
        if end.at_rest and np.all(held):
            margin = up(since[:, None] * leg.torque_rate)
            found = found.meet(Interval(hold.lower - margin, hold.upper + margin))
    return found.outward()


def _since_ends(cells: Cells) -> tuple[Array, Array]:
    """Largest time since the start, and to the goal, in every cell [s], rounded up, each of shape (n,)."""
    times = Interval.at(cells.times.upper)
    return times.running().upper[1:], times[::-1].running().upper[:0:-1]


@dataclass(frozen=True, eq=False)
class End:
    """End of a leg, with time and motion measured from it.

    Attributes:
        inertia: M at the end [kg m²], shape (nv, nv).
        v: velocity at the end [rad/s or m/s], shape (nv,).
        outward: 1 if time runs forward from the end, -1 if backward.
    """

    inertia: Interval
    v: Array
    outward: int

    @classmethod
    def at(cls, leg: BoundLeg, outward: int) -> End | None:
        """A leg's start (outward 1) or goal (-1); None if any velocity is allowed."""
        v = (leg.start if outward > 0 else leg.goal).v
        return None if v is None else cls(leg.inertia[0 if outward > 0 else 1], v, outward)

    @property
    def momentum(self) -> Interval:
        """Momentum M v [N m s], shape (nv,)."""
        return self.inertia.times(self.v[:, None])[:, 0]


def reached(leg: BoundLeg, cells: Cells, forces: Forces, stop: StopCondition) -> Interval:
    """Bounds of the velocities in every cell, from both ends, shape (n, nv); wider ones once stopped."""
    lower, upper = cells.v.lower.copy(), cells.v.upper.copy()
    times, fastest = cells.times, accelerations(leg, cells)
    for outward in (1, -1):
        end, own = End.at(leg, outward), np.arange(len(lower))[::outward]
        later = np.flatnonzero(cells.elastic[own[1:]])
        own = own[: later[0] + 2] if later.size else own  # beyond an elastic cell momentum is unbounded
        if end is not None:
            found = by_momentum(leg, end, times[own], forces[own], stop)
            met = found.meet(_accelerated(end, times.upper[own], fastest[own]))
            lower[own], upper[own] = np.maximum(lower[own], met.lower), np.minimum(upper[own], met.upper)
    return Interval(lower, upper)


_AT_ONCE = 2**25
"""Products of one call that nothing stops: some seconds of arms of 30 joints, which have 500 multipliers."""


def by_momentum(leg: BoundLeg, end: End, times: Interval, forces: Forces, stop: StopCondition) -> Interval:
    """Bounds of the velocities in consecutive cells, shape (k, nv).

    Args:
        leg: leg with the end.
        end: end at which the first cell begins.
        times: lengths of the cells [s], shape (k,).
        forces: forces over the cells, in order from the end.
        stop: stopping condition, polled between multipliers of large arms; once true, the bounds so far are returned.
    """
    each, joint = multipliers(leg, end)
    lower, upper = forces.v.lower.copy(), forces.v.upper.copy()
    many = max(1, _AT_ONCE // forces.terms.inertia_derivatives.lower.size)
    for first in range(0, len(joint), many):
        if first and stop():
            break
        w, own = each[:, first : first + many], joint[first : first + many]
        units = np.zeros_like(w)
        units[own, np.arange(len(own))] = 1.0
        rate = forces.rate(w)
        changes = (times[:, None] * (rate if end.outward > 0 else -rate)).running()
        at_nodes = end.momentum[None].times(w) + changes
        momentum = at_nodes[:-1].hull(at_nodes[1:])
        bounds = momentum + forces.rate(np.zeros_like(w), Interval.at(units), Interval.at(-w))
        np.maximum.at(lower.T, own, bounds.lower.T)
        np.minimum.at(upper.T, own, bounds.upper.T)
    return forces.v.meet(Interval(lower, upper))


def _accelerated(end: End, times: Array, most: Array) -> Interval:
    """Bounds by the largest accelerations, shape (k, nv)."""
    margin = (Interval.at(times[:, None]) * Interval.at(np.nan_to_num(most, posinf=0.0))).running().upper[1:]
    margin = np.where(np.isfinite(most), margin, np.inf)
    return Interval.at(end.v) + Interval(-margin, margin)


def multipliers(leg: BoundLeg, end: End) -> tuple[Array, NDArray[np.intp]]:
    """Multipliers, shape (nv, m), and the joint bounded by each, shape (m,)."""
    inertia = end.inertia.lower / 2 + end.inertia.upper / 2
    nv = len(inertia)
    torque = leg.torque.actuators.strongest
    times = leg.velocity / (np.abs(np.linalg.inv(inertia)) @ torque)  # [s] to the greatest speed, roughly
    slowest = np.argsort(-times)
    columns, joints = [], []
    for size in range(1, nv + 1):
        free = slowest[:size]
        solved = np.zeros((nv, size))
        solved[free] = np.linalg.inv(inertia[np.ix_(free, free)])
        columns.append(solved)
        joints.append(free)
    return np.concatenate(columns, axis=1), np.concatenate(joints)


def at_ends(leg: BoundLeg, w: Array, speed: Array) -> Interval:
    """w(0)ᵀ p(0) − w(T)ᵀ p(T), and likewise for velocities under acceleration limits, if there are multipliers.

    Args:
        leg: leg with the ends.
        w: multipliers of the momentum at the nodes, shape (nodes, nv).
        speed: multipliers of the velocities, likewise.
    """
    total = Interval.at(0.0)
    for outward, node in ((1, 0), (-1, -1)):
        end = End.at(leg, outward)
        if end is not None:
            share = (end.momentum * Interval.at(w[node])).sum(0)
            share = share + (Interval.at(end.v) * Interval.at(speed[node])).sum(0)
            total = total + (share if outward > 0 else -share)
    return total
