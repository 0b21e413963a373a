"""Cells of time of a motion that passes regions, each with boxes of the reachable positions and velocities.

Between two regions time is cut into cells of fixed lengths, whose sum no motion falls short of, and one elastic cell
that is as long as the motion wants. So the cells speak of all motions, whenever they pass the regions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.optimal.bound.enclosure.affine import Affine
from armdyn.optimal.bound.enclosure.interval import Interval, joined
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.reach import End, by_momentum
from armdyn.optimal.bound.region import BoundRegion
from armdyn.optimal.task.policy.bound import BoundPolicy


@dataclass(frozen=True, eq=False)
class Phase:
    """Part of a motion, between regions that it passes.

    Attributes:
        least: no motion takes less time for it [s].
        box: of all joint positions on it [rad or m], each end of shape (nv,).
        line: region in which it stays; None: there is none.
        goal: region where it ends, and the box of joint positions there; None: the leg's goal.
    """

    least: float
    box: Interval
    line: BoundRegion | None = None
    goal: tuple[BoundRegion, Interval] | None = None


@dataclass(frozen=True, eq=False)
class Course:
    """Cells of time in their order, and what is known of the nodes between them.

    Attributes:
        lengths: [s], shape (n,); of elastic cells 0.
        elastic: which cells are, shape (n,).
        room: no motion that spends longer [s] in the elastic cells is spoken of.
        lines: region in which the frame is all along a cell, of every cell; None: there is none.
        passed: region of the frame at a node, by its number; neither at the first nor at the last one.
        q: positions in the cells [rad or m], shape (n, nv).
        nodes: positions at the nodes, shape (n + 1, nv).
        v: velocities in the cells [rad/s or m/s], shape (n, nv).
    """

    lengths: Array
    elastic: Flags
    room: float
    lines: tuple[BoundRegion | None, ...]
    passed: dict[int, BoundRegion]
    q: Interval
    nodes: Interval
    v: Interval

    @classmethod
    def of(cls, leg: BoundLeg, phases: Sequence[Phase], longest: float) -> Course | None:
        """Cells within limits; None: no motion is as fast.

        Args:
            leg: its ends.
            phases: of the motion, in order.
            longest: no motion that takes longer [s] is spoken of.
        """
        lengths, lines, boxes = list[float](), list[BoundRegion | None](), list[Interval]()
        passed, nodes = dict[int, BoundRegion](), [leg.start.q]
        for phase in phases:
            own = _lengths(
                phase, phase is phases[0] and leg.start.at_rest, phase is phases[-1] and leg.goal.at_rest, leg.policy
            )
            lengths += own
            lines += [phase.line] * len(own)
            boxes += [phase.box] * len(own)
            nodes += [phase.box] * (len(own) - 1)
            if phase.goal is not None:
                passed[len(lengths)] = phase.goal[0]
            nodes.append(leg.goal.q if phase.goal is None else phase.goal[1])
        most = np.broadcast_to(leg.velocity, (len(lengths), len(leg.velocity)))
        everywhere = joined([box[None] for box in boxes]), joined([box[None] for box in nodes])
        elastic = np.array(lengths) == 0
        room = float((Interval.at(longest) - Interval.at(np.array(lengths)).sum(0)).upper)
        course = cls(np.array(lengths), elastic, room, tuple(lines), passed, *everywhere, Interval(-most, most))
        return course.narrowed(leg, course.v) if room > 0 else None

    @property
    def times(self) -> Interval:
        """Lengths of all cells [s], shape (n,)."""
        return Interval(self.lengths, np.where(self.elastic, self.room, self.lengths))

    def narrowed(self, leg: BoundLeg, v: Interval) -> Course | None:
        """The course with further bounds of the velocities, and the positions that these admit; None: no motion."""
        v, count = self.v.meet(v), len(self.lengths)
        ways = Interval(self.times.lower[:, None], self.times.upper[:, None]) * v
        onward, back = [leg.start.q], [leg.goal.q]
        for k in range(count):
            onward.append((onward[-1] + ways[k]).both(self.nodes[k + 1]))
            back.append((back[-1] - ways[count - 1 - k]).both(self.nodes[count - 1 - k]))
        nodes = joined([box[None] for box in onward]).both(joined([box[None] for box in reversed(back)]))
        if np.any(nodes.lower > nodes.upper):
            return None
        for k, region in self.passed.items():
            box = region.narrowed(nodes[k : k + 1], leg.policy, rounds=1)
            if box is None:
                return None
            nodes.lower[k], nodes.upper[k] = box.lower[0], box.upper[0]
        q = self.q
        for ends, way in ((nodes[:-1], ways), (nodes[1:], -ways)):
            q = q.both(ends.hull(ends + way))
        if np.any(q.lower > q.upper):
            return None
        for line in {line for line in self.lines if line is not None}:
            own = np.array([k for k, one in enumerate(self.lines) if one == line])
            box = line.narrowed(q[own], leg.policy, rounds=1)
            if box is None:
                return None
            q.lower[own], q.upper[own] = box.lower, box.upper
        inner = nodes[1:-1].both(q[:-1].both(q[1:]))
        nodes = joined([leg.start.q[None], inner, leg.goal.q[None]])
        return None if np.any(nodes.lower > nodes.upper) else replace(self, q=q, v=v, nodes=nodes)

    def reached(self, leg: BoundLeg, forces: Forces) -> Interval:
        """Bounds of the velocities in the cells by momentum from both ends, shape (n, nv)."""
        v, every = self.v, np.arange(len(self.lengths))
        for outward, own in ((1, every), (-1, every[::-1])):
            end = End.at(leg, outward)
            if end is not None:
                v = v.meet(by_momentum(leg, end, self.times[own], forces[own])[own])
        return v

    def ends(self, leg: BoundLeg) -> list[LegEnd | None]:
        """Known positions, or linear forms of them, at all nodes, the ends included; None: nothing known."""
        found: list[LegEnd | None] = [leg.start, *[None] * (len(self.lengths) - 1), leg.goal]
        owners = [None, *(self.passed.get(k) or self.lines[k] for k in range(1, len(self.lengths))), None]
        for region in {region for region in owners if region is not None}:
            own = [k for k, one in enumerate(owners) if one == region]
            forms = region.forms(self.nodes[own])
            for i, k in enumerate(own):
                found[k] = LegEnd(self.nodes[k], None, Affine(*(part[..., i : i + 1] for part in forms.parts)))
        return found


def _lengths(phase: Phase, from_rest: bool, to_rest: bool, numbers: BoundPolicy) -> list[float]:
    """Lengths of a phase's cells [s]: the elastic one, 0, is where the arm rests, or else in the middle."""
    if phase.least <= 0:
        return [0.0]
    count = numbers.phase_cells
    if from_rest != to_rest:
        fixed = [phase.least / count * (1 - 1e-12)] * count
        return [0.0, *fixed] if from_rest else [*fixed, 0.0]
    parts = numbers.phase_growth ** np.arange(count // 2)
    side = (phase.least / (2 * np.sum(parts)) * (1 - 1e-12) * parts).tolist()
    return [*side, 0.0, *side[::-1]]
