"""Shortest path over boxes of joint positions, layer after layer, whose edges are bounds of legs.

An edge has what velocity limits say, until the path needs it: then momentum improves it. Where all of the path's edges
are improved, its widest region is cut in two. The path's length is a valid bound all along.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.optimal.bound.enclosure.interval import Interval, down, joined, sum_down
from armdyn.optimal.bound.goal_set import TURN, GoalSet
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.leg_bound import leg_bound
from armdyn.optimal.bound.passing import Passage, passing_bound
from armdyn.optimal.bound.rates import least_times

Stop = Callable[[], bool]


@dataclass(frozen=True, eq=False)
class Region:
    """Joint positions at a stop: one, or those of a goal set within boxes that touch.

    Attributes:
        boxes: shape (boxes, nv).
        goals: whose members count; None: all of the boxes.
        turned: number of the part of the goal set, and by how many whole turns it is turned, shape (nv,); None: it is
            no whole part.
    """

    boxes: Interval
    goals: GoalSet | None = None
    turned: tuple[int, Array] | None = None

    @classmethod
    def point(cls, q: Array) -> Region:
        """One joint position, shape (nv,)."""
        return cls(Interval.at(q)[None])

    @property
    def hull(self) -> Interval:
        """One box that holds all, each end of shape (nv,)."""
        return Interval(np.min(self.boxes.lower, axis=0), np.max(self.boxes.upper, axis=0))

    def end(self, v: Array | None) -> LegEnd:
        """The region as an end of a leg, with velocities there."""
        hull = self.hull
        return LegEnd(hull, v, None if self.goals is None or self.is_point else self.goals.closure_over(hull))

    @property
    def is_point(self) -> bool:
        """Whether it is as good as one joint position, or has none that could be left out."""
        return self.goals is None or self.size < self.goals.policy.isolated

    @property
    def size(self) -> float:
        """Half width of the hull [rad or m]."""
        return float(np.max(self.hull.radius))

    def halves(self, stop: Stop) -> list[Region]:
        """The region cut in two, perhaps with less in it."""
        if self.goals is None:
            return [self]
        boxes = self.boxes
        if len(boxes.lower) == 1:
            reach = float(np.max((boxes.upper - boxes.lower) * self.goals.levers))
            boxes = self.goals.enclosed(boxes, reach / 2, stop)
        return [Region(part, self.goals) for part in self.goals.cut(boxes)] if len(boxes.lower) else []


def shortest_times(leg: BoundLeg, starts: Sequence[Region], goals: Sequence[Region]) -> Array:
    """Times of a leg between regions by limits of single joints [s], rounded down, shape (starts, goals)."""
    if not (starts and goals):
        return np.zeros((len(starts), len(goals)))
    first, last = (joined([region.hull[None] for region in side]) for side in (starts, goals))
    way = np.maximum((last[None] - first[:, None]).mignitude, 0.0)
    times = np.where(way > 0, way / leg.velocity, 0.0)
    if leg.start.at_rest and leg.goal.at_rest:
        times = np.maximum(times, least_times(way, leg.velocity, leg.acceleration, leg.jerk))
    return np.maximum(down(np.max(times, axis=2)), 0.0)


@dataclass(frozen=True, eq=False)
class Route:
    """Regions, one per layer, and the bounds of the legs between them [s]."""

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
        legs: one less than layers; their ends say the velocities there.
        passages: what each leg passes on its way; None: nothing.
        layers: regions of every stop.
        bounds: of every leg [s], shape (regions of its start, regions of its goal).
        tried: by momentum, likewise.
    """

    def __init__(
        self,
        legs: Sequence[BoundLeg],
        layers: Sequence[Sequence[Region]],
        passages: Sequence[Passage | None] | None = None,
    ) -> None:
        self.legs, self.layers = tuple(legs), [list(layer) for layer in layers]
        self.passages = tuple(passages or [None] * len(self.legs))
        pairs = zip(self.legs, self.layers[:-1], self.layers[1:], strict=True)
        self.bounds = [shortest_times(leg, *ends) for leg, *ends in pairs]
        # Between any velocities the velocity limits say all there is.
        free = [leg.start.v is None and leg.goal.v is None for leg in self.legs]
        self.tried = [np.full(bounds.shape, one) for bounds, one in zip(self.bounds, free, strict=True)]

    def path(self) -> Route | None:
        """The shortest path; None: there is none."""
        least, before = np.zeros(len(self.layers[0])), []
        for bounds in self.bounds:
            if bounds.size == 0:
                return None
            sums = least[:, None] + bounds
            before.append(np.argmin(sums, axis=0))
            least = np.min(sums, axis=0)
        at = [int(np.argmin(least))]
        for origin in reversed(before):
            at.insert(0, int(origin[at[0]]))
        regions = tuple(layer[k] for layer, k in zip(self.layers, at, strict=True))
        return Route(tuple(at), regions, tuple(float(b[i]) for b, i in zip(self.bounds, pairwise(at), strict=True)))

    def improve(self, enough: float, most: int, stop: Stop) -> Route | None:
        """Improve bounds of the shortest path until it is long enough [s], or so many legs have been bounded."""
        tries = 0
        while True:
            path = self.path()
            if path is None or path.duration >= enough or tries >= most or stop():
                return path
            wide = [region.size for region in path.regions if not region.is_point]
            if max(wide, default=0.0) > self.legs[0].policy.narrow and self._cut(path, stop):
                continue
            untried = [
                k for k, (tried, ends) in enumerate(zip(self.tried, pairwise(path.at), strict=True)) if not tried[ends]
            ]
            if untried:
                self._bound(min(untried, key=lambda k: path.legs[k]), path, enough, stop)
                tries += 1
            elif not self._cut(path, stop):
                return path

    def _bound(self, k: int, path: Route, enough: float, stop: Stop) -> None:
        """Bound a leg of the path by momentum, as far as the path is then long enough [s]."""
        leg, at = self.legs[k], path.at[k : k + 2]
        start, goal = path.regions[k].end(leg.start.v), path.regions[k + 1].end(leg.goal.v)
        self.tried[k][at] = done = True
        if np.all(np.isfinite((goal.q - start.q).magnitude)):
            points = all(region.is_point for region in path.regions[k : k + 2])
            policy = leg.policy if points else leg.policy.between_wide
            same, turns = self._turned_alike(k, at)
            position = leg.position + TURN * Interval(-turns, turns)
            one = replace(leg, start=start, goal=goal, position=position.hull(start.q).hull(goal.q), policy=policy)
            bound, passage = leg_bound(one, stop, float(self.bounds[k][at]))[0], self.passages[k]
            # Of all paths along this edge none has shorter others than the shortest path of all.
            most = enough - path.duration + path.legs[k]
            if passage is not None and points and bound < most:
                bound, done = passing_bound(one, passage, bound, most, stop)
            self.bounds[k][same] = np.maximum(self.bounds[k][same], bound)
            self.tried[k][same] = done

    def _turned_alike(self, k: int, at: tuple[int, ...]) -> tuple[Flags, Array]:
        """Edges of a leg that are one edge turned at both ends alike, and by how many turns at most, shape (nv,).

        Only the position limits tell them apart: inertia and weight are the same after whole turns.
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

    def _cut(self, path: Route, stop: Stop) -> bool:
        """Cut the widest region of the path in two; whether one was left to be cut."""
        sizes = [0.0 if one.is_point else one.size for one in path.regions]
        k = int(np.argmax(sizes))
        if sizes[k] == 0:
            return False
        at, halves = path.at[k], path.regions[k].halves(stop)
        count = len(halves)
        self.layers[k][at : at + 1] = halves
        for leg, axis in ((k - 1, 1), (k, 0)):
            if 0 <= leg < len(self.legs):
                inherited = np.repeat(np.take(self.bounds[leg], [at], axis), count, axis)
                ends = (self.layers[leg], halves) if axis else (halves, self.layers[leg + 1])
                new = np.maximum(inherited, shortest_times(self.legs[leg], *ends))
                self.bounds[leg] = np.insert(np.delete(self.bounds[leg], at, axis), [at] * count, new, axis)
                ends_free = self.legs[leg].start.v is None and self.legs[leg].goal.v is None
                fresh = np.full(new.shape, ends_free)
                self.tried[leg] = np.insert(np.delete(self.tried[leg], at, axis), [at] * count, fresh, axis)
        return True
