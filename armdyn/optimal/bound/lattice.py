"""Shortest path over boxes of joint positions, layer by layer, with bounds of legs as edges.

An edge has the bound by velocity limits until the path uses it: then momentum improves the bound, then the regions on
the way. If no edge of the path can be improved any more, its widest region is bisected. The path's length is a valid
bound at any time. Edges of the shortest paths are improved together, in parallel processes: a fixed number of edges, so
that the result does not depend on the number of processes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import TypeVar

import numpy as np

from armdyn.arguments import StopCondition, expect
from armdyn.arrays import Array, Flags
from armdyn.optimal.bound.enclosure import TURN, Interval, joined, sum_down
from armdyn.optimal.bound.frame_sets import GoalSet
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.leg_bound import Passage, leg_bound, passing_bound
from armdyn.parallel import in_processes

Item = TypeVar("Item")


class Stopped(Exception):  # noqa: N818  # not an error
    """The work was stopped before there were bounds."""


def polled(items: Iterable[Item], stop: StopCondition) -> Iterator[Item]:
    """Yield items; raise once the stop condition holds.

    Raises:
        Stopped: the stopping condition is true before one.
    """
    for item in items:
        if stop():
            raise Stopped
        yield item


@dataclass(frozen=True, eq=False)
class Edge:
    """A leg between two regions whose bound is to be improved.

    Attributes:
        leg: index of the leg.
        motion: motion between the regions.
        passage: regions and lines on the way; None: not considered yet.
        known: bound so far [s].
        most: bound beyond which improvement is useless [s].
    """

    leg: int
    motion: BoundLeg
    passage: Passage | None
    known: float
    most: float

    def bounded(self, stop: StopCondition) -> tuple[float, bool, int]:
        """The bound [s], whether further tries would gain nothing, and the number of linear programs."""
        counted = _Counted(stop)
        if not np.all(np.isfinite(self.motion.away.magnitude)):
            return self.known, True, 1
        if self.passage is None:
            return leg_bound(self.motion, counted, self.known)[0], True, counted.programs
        return *passing_bound(self.motion, self.passage, self.known, self.most, counted), counted.programs


@dataclass(eq=False)
class _Counted:
    """Stopping condition that counts its polls: one per linear program."""

    stop: StopCondition
    programs: int = 0

    def __call__(self) -> bool:
        self.programs += 1
        return self.stop()


@dataclass(eq=False)
class Effort:
    """Budget of work on bounds: a count, so that it is the same on every machine.

    Attributes:
        left: number of linear programs left, 0.02 to 0.1 s each; started edges are finished.
        stop: stopping condition, polled regularly; once true, the bounds so far are kept.
        workers: largest number of processes; None: one per core. The bounds do not depend on it.
        report: called with a line of text.
        others: bound of the other motions, and rests, for the report [s].
    """

    left: float
    stop: StopCondition = lambda: False
    workers: int | None = 1
    report: Callable[[str], object] = lambda text: None
    others: float = 0.0

    def __bool__(self) -> bool:
        return self.left > 0 and not self.stop()

    def report_bound(self, bound: float) -> None:
        """Report the bound so far [s] of the motions under work."""
        self.report(f"proven: not below {self.others + bound:.4f} s; {max(self.left, 0):.0f} linear programs are left")

    def spent_on(self, edges: Sequence[Edge]) -> list[tuple[float, bool]]:
        """Bounds of edges [s], and whether further tries would gain nothing."""
        found = list(in_processes([partial(edge.bounded, self.stop) for edge in edges], self.workers))
        self.left -= sum(programs for _, _, programs in found)
        return [(bound, done) for bound, done, _ in found]

    @contextmanager
    def shared(self, count: int) -> Iterator[Effort]:
        """Context in which one of `count` equal parts of the effort left may be spent."""
        kept = self.left * (1 - 1 / count)
        self.left -= kept
        yield self
        self.left += kept


NOTHING, PASSAGE, MOMENTUM = range(3)
"""Next improvement of an edge's bound: none, by the regions on the way, or by momentum and then by these."""


@dataclass(frozen=True, eq=False)
class Region:
    """Joint positions at a stop: a single one, or those of a goal set within touching boxes.

    Attributes:
        boxes: shape (boxes, nv).
        goals: goal set of which only the members count; None: all positions in the boxes.
        turned: index of the part of the goal set, and the whole turns by which it is shifted, shape (nv,); None: not a
            whole part.
    """

    boxes: Interval
    goals: GoalSet | None = None
    turned: tuple[int, Array] | None = None

    @property
    def hull(self) -> Interval:
        """Box that encloses the region, each end of shape (nv,)."""
        return self.boxes.around

    def end(self, v: Array | None) -> LegEnd:
        """The region as an end of a leg, with the velocities v."""
        hull = self.hull
        return LegEnd(hull, v, None if self.goals is None or self.is_point else self.goals.closure_over(hull))

    @property
    def is_point(self) -> bool:
        """Whether the region is a single joint position, or cannot be divided further."""
        return self.goals is None or self.size < self.goals.policy.tiny

    @property
    def size(self) -> float:
        """Largest half width of the hull among the joints [rad or m]."""
        return float(np.max(self.hull.radius))

    def halves(self, stop: StopCondition) -> list[Region]:
        """Bisect a region of a goal set, and tighten the halves if possible."""
        goals, boxes = expect(self.goals, GoalSet, "goals"), self.boxes
        if len(boxes.lower) == 1:
            reach = float(np.max((boxes.upper - boxes.lower) * goals.levers))
            boxes = goals.enclosed(boxes, reach / 2, stop)
        return [Region(part, goals) for part in goals.cut(boxes)] if len(boxes.lower) else []


def shortest_times(leg: BoundLeg, starts: Sequence[Region], goals: Sequence[Region]) -> Array:
    """Times of a leg between regions by limits of single joints [s], rounded down, shape (starts, goals)."""
    if not (starts and goals):
        return np.zeros((len(starts), len(goals)))
    first, last = (joined([region.hull[None] for region in side]) for side in (starts, goals))
    return np.asarray(np.max(leg.alone(last[None] - first[:, None]), axis=2))


@dataclass(frozen=True, eq=False)
class Route:
    """Regions, one per layer, and bounds of the legs between them [s]."""

    at: tuple[int, ...]
    regions: tuple[Region, ...]
    legs: tuple[float, ...]

    @property
    def duration(self) -> float:
        """Sum of the bounds [s], rounded down."""
        return sum_down(self.legs)


class Lattice:
    """Layers of regions, and bounds of the legs between any two of neighbouring layers.

    Attributes:
        legs: legs, one less than layers, with the velocities at their ends.
        passages: regions and lines that each leg passes; None: none.
        layers: regions of every stop.
        bounds: of every leg [s], shape (regions of its start, regions of its goal).
        left: next improvement of each bound, likewise.
        under_way: index among the edges under improvement, or -1, likewise.
    """

    def __init__(
        self,
        legs: Sequence[BoundLeg],
        layers: Sequence[Sequence[Region]],
        passages: Sequence[Passage | None] | None = None,
        stop: StopCondition = lambda: False,
    ) -> None:
        """Bound the legs by limits of single joints.

        Raises:
            Stopped: `stop` is true before all are.
        """
        self.legs, self.layers = tuple(legs), [list(layer) for layer in layers]
        self.passages = tuple(passages or [None] * len(self.legs))
        pairs = zip(self.legs, self.layers[:-1], self.layers[1:], strict=True)
        self.bounds = [shortest_times(leg, *ends) for leg, *ends in polled(pairs, stop)]
        self.left = [np.full(own.shape, _first(leg)) for own, leg in zip(self.bounds, self.legs, strict=True)]
        self.under_way = [np.full(own.shape, -1) for own in self.bounds]

    def path(self) -> Route | None:
        """The shortest path; None: no path."""
        return self._path(self.bounds)

    def _path(self, lengths: Sequence[Array]) -> Route | None:
        """Shortest path by given lengths of the edges [s]; None if none is finite."""
        least, before = np.zeros(len(self.layers[0])), []
        for each in lengths:
            if each.size == 0:
                return None
            sums = least[:, None] + each
            before.append(np.argmin(sums, axis=0))
            least = np.min(sums, axis=0)
        at = [int(np.argmin(least))]
        if np.isinf(least[at[0]]):
            return None
        for origin in reversed(before):
            at.insert(0, int(origin[at[0]]))
        regions = tuple(layer[k] for layer, k in zip(self.layers, at, strict=True))
        return Route(tuple(at), regions, tuple(float(b[i]) for b, i in zip(self.bounds, pairwise(at), strict=True)))

    def improve(self, enough: float, effort: Effort) -> Route | None:
        """Improve bounds of the shortest paths up to a length [s], within the effort."""
        while (path := self.path()) is not None and path.duration < enough and effort:
            effort.report_bound(path.duration)
            if not (edges := self.next_edges(enough, effort.stop)):
                break
            self.learn(edges, effort.spent_on(edges))
        return self.path()

    def next_edges(self, enough: float, stop: StopCondition) -> list[Edge]:
        """Next edges of the shortest paths to improve, up to a length [s]; possibly none."""
        found: list[Edge] = []
        numbers = self.legs[0].policy
        while len(found) < numbers.at_once and not stop():
            path = self._path(
                [np.where(busy < 0, own, np.inf) for own, busy in zip(self.bounds, self.under_way, strict=True)]
            )
            if path is None or path.duration >= enough:
                break
            wide = [region.size for region in path.regions if not region.is_point]
            if max(wide, default=0.0) > numbers.sizes[0] and self._cut(path, stop):
                continue
            left = [int(own[ends]) for own, ends in zip(self.left, pairwise(path.at), strict=True)]
            for k in (k for k, own in enumerate(left) if own and own == max(left)):
                found.append(self._edge(k, path, enough, len(found)))
            if not any(left) and not self._cut(path, stop):
                break
        return found

    def _edge(self, k: int, path: Route, enough: float, number: int) -> Edge:
        """A leg of the path as an edge to improve; its target makes the path long enough [s]."""
        leg, at = self.legs[k], path.at[k : k + 2]
        start, goal = path.regions[k].end(leg.start.v), path.regions[k + 1].end(leg.goal.v)
        points, passage = all(region.is_point for region in path.regions[k : k + 2]), self.passages[k]
        same, turns = self._turned_alike(k, at)
        position = (leg.position + TURN * Interval(-turns, turns)).hull(start.q).hull(goal.q)
        policy = leg.policy if points else leg.policy.between_wide
        passing = passage if self.left[k][at] == PASSAGE else None
        self.under_way[k][same] = number
        self.left[k][same] = PASSAGE if points and passage is not None and passing is None else NOTHING
        return Edge(
            leg=k,
            motion=replace(leg, start=start, goal=goal, position=position, policy=policy),
            passage=passing,
            known=float(self.bounds[k][at]),
            # The rest of any path along this edge is at least the rest of the shortest path.
            most=enough - path.duration + path.legs[k],
        )

    def learn(self, edges: Sequence[Edge], bounds: Sequence[tuple[float, bool]]) -> None:
        """Record the bounds of edges [s], and whether further tries would gain nothing."""
        for number, (edge, (bound, done)) in enumerate(zip(edges, bounds, strict=True)):
            own = self.under_way[edge.leg] == number
            self.bounds[edge.leg][own] = np.maximum(self.bounds[edge.leg][own], bound)
            self.under_way[edge.leg][own] = -1
            if not done:
                self.left[edge.leg][own] = PASSAGE

    def _turned_alike(self, k: int, at: tuple[int, ...]) -> tuple[Flags, Array]:
        """Edges of a leg that are the same edge, turned alike at both ends, and the largest turns, shape (nv,).

        Only the position limits distinguish them: inertia and gravity are the same after whole turns.
        """
        sides, none = (self.layers[k], self.layers[k + 1]), np.zeros(self.legs[k].dynamics.nv)
        same = np.zeros((len(sides[0]), len(sides[1])), dtype=bool)
        same[at] = True
        ends = [turned for side, i in zip(sides, at, strict=True) if (turned := side[i].turned)]
        if len(ends) < 2:
            return same, none
        parts, by = [], []
        for side, (part, turns) in zip(sides, ends, strict=True):
            parts.append(np.array([one.turned is not None and one.turned[0] == part for one in side]))
            by.append(np.array([none if one.turned is None else one.turned[1] - turns for one in side]))
        same |= parts[0][:, None] & parts[1] & np.all(by[0][:, None] == by[1], axis=2)
        return same, np.max(np.abs(by[0][np.any(same, axis=1)]), axis=0)

    def _cut(self, path: Route, stop: StopCondition) -> bool:
        """Bisect the widest region of the path; False if none can be bisected."""
        sizes = [0.0 if one.is_point else one.size for one in path.regions]
        k = int(np.argmax(sizes))
        if sizes[k] == 0:
            return False
        at, halves = path.at[k], path.regions[k].halves(stop)
        count = len(halves)
        self.layers[k][at : at + 1] = halves
        for leg, axis in ((k - 1, 1), (k, 0)):
            if 0 <= leg < len(self.legs):
                bounds, busy = (
                    np.repeat(np.take(table[leg], [at], axis), count, axis) for table in (self.bounds, self.under_way)
                )
                ends = (self.layers[leg], halves) if axis else (halves, self.layers[leg + 1])
                bounds = np.maximum(bounds, shortest_times(self.legs[leg], *ends))
                left = np.full(bounds.shape, _first(self.legs[leg]))
                for table, new in ((self.bounds, bounds), (self.left, left), (self.under_way, busy)):
                    table[leg] = np.insert(np.delete(table[leg], at, axis), [at] * count, new, axis)
        return True


def _first(leg: BoundLeg) -> int:
    """The method that improves a leg first: none between free velocities, where velocity limits are exact."""
    return NOTHING if leg.start.v is None and leg.goal.v is None else MOMENTUM
