"""Lower bound on the duration of a chain of motions, over all joint positions at the stops between them.

At a stop the arm is at a given joint position, or at any that brings a frame to a pose. Boxes enclose all of these, and
a leg between two boxes has the bound of `leg_bound`. No chain is faster than the shortest path over the boxes
(Bellman's principle), whatever the bounds of its legs: `lattice.py`. Boxes that velocity limits make unreachable within
the duration of a known chain are left out. Stops with one joint position divide the chain into runs with separate
bounds.

The places between two single joint positions are covered together: positions reachable within the velocity limits, from
the one, through boxes of all places between, to the other in time. Coarse boxes are pruned before they are bisected.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from armdyn.arguments import StopCondition
from armdyn.arrays import Array, Flags
from armdyn.dynamics.symbolic import Dynamics
from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.bound.enclosure import ROUNDED, TURN, Interval, down, sum_down, up
from armdyn.optimal.bound.frame_sets import BoundRegion, GoalSet, Within, clusters, is_closed
from armdyn.optimal.bound.lattice import Effort, Lattice, Region, Stopped, polled
from armdyn.optimal.bound.leg import BoundLeg, bound_legs, least_time
from armdyn.optimal.bound.leg_bound import Passage
from armdyn.optimal.constraints.regions import FrameRegion
from armdyn.optimal.problem.policy.bound import BoundPolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem


def chain_bound(
    problems: Sequence[MinimumTimeProblem],
    stops: Sequence[Place],
    upper: float,
    effort: Effort,
    policy: BoundPolicy | None = None,
) -> float:
    """Prove a lower bound on the sum of the durations of motions, each starting where the one before ends.

    Args:
        problems: one per motion: its robot with its payload, limits, path constraints, velocities at both ends
            and via points. The problems' own starts and goals are ignored.
        stops: one more than problems: joint positions [rad or m], shape (nv,), or a `GoalPose` for all joint positions
            within the limits that reach it.
        upper: duration of a known chain [s]: the bound is at most this, and improved until nearly equal. It may be
            infinite if all stops are joint positions.
        effort: budget of work; when it is spent, the bound so far is returned.
        policy: tuned numbers; None: the defaults. The bound is valid for any.

    Returns:
        The bound [s]; 0 if nothing is proven, as without a velocity limit of any moving joint.

    Raises:
        BridgeError: the dynamics have an operation without an interval extension.
    """
    numbers = policy or BoundPolicy()
    vias = [[_via(problem, widest) for problem in problems] for widest in (0.0, numbers.sizes[1])]
    if vias[0] == vias[1]:
        vias.pop()  # no regions, or none that could help
    found = []
    for k, via in enumerate(vias):
        with effort.shared(len(vias) - k):
            found.append(_bounded(_runs(problems, via, stops, numbers), upper, effort))
    return max(found)


def _bounded(runs: Sequence[_Run], longest: float, effort: Effort) -> float:
    """Lower bound on the duration of consecutive runs [s], at most `longest`; see `chain_bound`.

    A run has at most the time that the bounds of the other runs leave. While it is under work, these are part of
    `effort.others`, for the report.
    """
    found, before = [run.least for run in runs], effort.others
    order = sorted(range(len(runs)), key=lambda k: len(runs[k].legs))  # point to point first: less time is left
    for done, k in enumerate(order):
        others = sum_down([one for j, one in enumerate(found) if j != k])
        effort.others = before + others
        with effort.shared(len(runs) - done):
            found[k] = runs[k].bounded(longest - others, effort)
    effort.others = before
    return min(sum_down(found), longest)


def _via(problem: MinimumTimeProblem, widest: float) -> list[int]:
    """Indices of the via points that are places of the chain, from 0.

    These are joint positions, and regions that equations enclose, with deviations of at most `widest` [m, rad] unless a
    line leads to or from the region.
    """
    passed, lines = [], _lines(problem)
    for k, one in enumerate(problem.via):
        narrow = isinstance(one, GoalPose) and is_closed(one) and lines.keys().isdisjoint((k, k + 1))
        if not isinstance(one, GoalPose) or (narrow and np.max(one.deviations[np.isfinite(one.deviations)]) < widest):
            passed.append(k)
    return passed


def _lines(problem: MinimumTimeProblem) -> dict[int, GoalPose]:
    """Regions in which a frame stays on one leg, by the leg's index between the via points."""
    given = (one for one in problem.path_constraints if isinstance(one, FrameRegion))
    return {one.leg: one.region for one in given if one.leg is not None}


def _passages(problem: MinimumTimeProblem, passed: Sequence[int], dynamics: Dynamics) -> list[Passage | None]:
    """Regions and lines between consecutive places of a problem; `passed`: the via points that are places."""
    lines = {leg: BoundRegion(dynamics, region) for leg, region in _lines(problem).items()}
    found: list[Passage | None] = []
    for first, last in pairwise([-1, *passed, len(problem.via)]):
        regions = tuple(BoundRegion(dynamics, problem.via_regions[k]) for k in range(first + 1, last))
        own = {leg - first - 1: line for leg, line in lines.items() if first < leg <= last}
        found.append(Passage(regions, own) if regions else None)
    return found


def _runs(
    problems: Sequence[MinimumTimeProblem], via: Sequence[Sequence[int]], stops: Sequence[Place], policy: BoundPolicy
) -> list[_Run]:
    """Split the chain at single joint positions."""
    legs: list[BoundLeg] = []
    passages: list[Passage | None] = []
    places = [stops[0]]
    for problem, passed, stop in zip(problems, via, stops[1:], strict=True):
        own = bound_legs(problem, policy)
        begins = [own[0].start, *(replace(own[0].start, v=None) for _ in passed)]
        ends = [*(replace(own[-1].goal, v=None) for _ in passed), own[-1].goal]
        legs += [replace(own[0], start=begin, goal=end) for begin, end in zip(begins, ends, strict=True)]
        passages += _passages(problem, passed, own[0].dynamics)
        between = [problem.via_regions.get(k, problem.poses[k + 1]) for k in passed]
        places += [*between, stop]
    cuts = [k for k, place in enumerate(places) if not isinstance(place, GoalPose)]
    cuts = sorted({0, *cuts, len(legs)})
    return [_Run(tuple(legs[a:b]), tuple(places[a : b + 1]), tuple(passages[a:b])) for a, b in pairwise(cuts)]


@dataclass(frozen=True, eq=False)
class _Run:
    """Consecutive legs between goal poses; the first and the last place may be points.

    Attributes:
        legs: legs, with the velocities at their ends.
        places: one more than legs.
        passages: regions and lines that each leg passes; None: none.
    """

    legs: tuple[BoundLeg, ...]
    places: tuple[Place, ...]
    passages: tuple[Passage | None, ...]

    @property
    def least(self) -> float:
        """Bound of the run by the velocity limits alone [s]; 0 unless its first and last place are points."""
        first, last = self.places[0], self.places[-1]
        if isinstance(first, GoalPose) or isinstance(last, GoalPose):
            return 0.0
        fastest = np.max([leg.velocity for leg in self.legs], axis=0)
        return float(least_time(Interval.at(first), Interval.at(last), fastest))

    def bounded(self, longest: float, effort: Effort) -> float:
        """Lower bound of this run [s], for motions of at most a duration [s]."""
        try:
            layers = covers(self.legs, self.places, longest, effort.stop)
            lattice = Lattice(self.legs, layers, self.passages, effort.stop)
        except Stopped:
            return self.least
        path = lattice.improve(longest * (1 - self.legs[0].policy.near_enough), effort)
        return longest if path is None else min(path.duration, longest)  # None: no chain is that fast


Place = Array | GoalPose


def covers(
    legs: Sequence[BoundLeg], places: Sequence[Place], longest: float, stop: StopCondition
) -> list[list[Region]]:
    """Regions of consecutive places.

    Args:
        legs: legs, one less than places.
        places: joint positions, shape (nv,), or goal sets of a frame's pose.
        longest: largest duration through all places [s].
        stop: stopping condition, polled regularly.

    Raises:
        Stopped: it is true.
    """
    ends = tuple(place for place in (places[0], places[-1]) if not isinstance(place, GoalPose))
    velocity = np.max([leg.velocity for leg in legs], axis=0)
    sets: list[GoalSet | None] = []
    boxes: list[Interval] = []
    for k, place in enumerate(places):
        if not isinstance(place, GoalPose):
            sets.append(None)
            boxes.append(Interval.at(place)[None])
            continue
        own = legs[max(k - 1, 0) : k + 1]
        position = own[0].position.meet(own[-1].position)
        if not ends:
            position = _of_one_turn(position, velocity, own[0].dynamics.robot.slides, longest)
        within = Within(ends, velocity, position, longest)
        goals = GoalSet(own[0].dynamics, place, within, own[0].policy)
        whole = goals.whole
        sets.append(None if whole is None else goals)
        boxes.append(within.box[None] if whole is None else whole)
    tried = [boxes]
    for size in polled(legs[0].policy.cover, stop):
        finer = [
            box if goals is None else goals.enclosed(box, size, stop)
            for goals, box in zip(sets, tried[-1], strict=True)
        ]
        if not _few([len(box.lower) for box in finer], legs):
            break  # the region itself is as large as that
        tried.append(_thinned(legs, sets, finer, longest, stop))
    for boxes in reversed(tried):
        regions = [_regions(goals, box, stop) for goals, box in zip(sets, boxes, strict=True)]
        if _few([len(each) for each in regions], legs):
            break
    return regions


def _of_one_turn(position: Interval, velocity: Array, slides: Flags, longest: float) -> Interval:
    """Limits of a chain whose endless joints start within one turn: motions are the same after whole turns."""
    endless = ~slides & np.isinf(position.lower) & np.isinf(position.upper) & np.isfinite(velocity)
    far = up(up(velocity * longest) + TURN.upper)
    return Interval(np.where(endless, -far, position.lower), np.where(endless, far, position.upper))


def _few(counts: Sequence[int], legs: Sequence[BoundLeg]) -> bool:
    """Whether counts of boxes at consecutive stops give few enough pairs for the check by velocity limits."""
    return all(a * b <= legs[0].policy.most_pairs for a, b in pairwise(counts))


def _regions(goals: GoalSet | None, boxes: Interval, stop: StopCondition) -> list[Region]:
    """Regions of boxes: joined if they touch and joint positions are isolated, and turned by all whole turns."""
    if goals is None:
        return [Region(boxes)] if len(boxes.lower) else []
    if goals.continuous:
        parts = [boxes[k : k + 1] for k in range(len(boxes.lower))]
    else:
        parts = [goals.shrunk(part, stop) for part in polled(clusters(boxes, stop), stop)]
    turned = ((k, one) for k, part in polled(enumerate(parts), stop) if len(part.lower) for one in goals.turned(part))
    return [Region(boxes, goals, (k, turns)) for k, (boxes, turns) in turned]


def _thinned(
    legs: Sequence[BoundLeg], sets: Sequence[GoalSet | None], boxes: list[Interval], longest: float, stop: StopCondition
) -> list[Interval]:
    """Boxes that a motion may pass within a time [s]."""
    none = np.zeros(legs[0].dynamics.nv, dtype=bool)
    turning = np.any([none, *(goals.turning for goals in sets if goals is not None)], axis=0)
    pairs = zip(legs, boxes[:-1], boxes[1:], strict=True)
    times = [least_time(a[:, None], b[None], leg.velocity, turning) for leg, a, b in polled(pairs, stop)]
    forward, backward = [np.zeros(len(boxes[0].lower))], [np.zeros(len(boxes[-1].lower))]
    for each in times:
        forward.append(np.min(forward[-1][:, None] + each, axis=0, initial=np.inf))
    for each in reversed(times):
        backward.insert(0, np.min(each + backward[0], axis=1, initial=np.inf))
    passed = [down(down(a + b)) for a, b in zip(forward, backward, strict=True)]
    return [box[time * (1 - ROUNDED) < longest] for box, time in zip(boxes, passed, strict=True)]
