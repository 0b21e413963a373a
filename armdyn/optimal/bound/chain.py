"""Lower bound on the duration of a chain of motions, over all joint positions at the stops between them.

At a stop the arm is at a given joint position, or at any that brings a frame to a pose. Boxes enclose all of these, and
a leg between two boxes has the bound of `leg_bound`. No chain is faster than the shortest path over the boxes
(Bellman's principle), whatever the bounds of its legs: `lattice.py`. Boxes that velocity limits make unreachable within
the duration of a known chain are left out. Stops with one joint position divide the chain into runs with separate
bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.arguments import number, several
from armdyn.arrays import Array
from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import pose_given
from armdyn.models.scene.reaching import GoalPose, poses_reaching
from armdyn.optimal.bound.covers import Place, covers
from armdyn.optimal.bound.effort import Effort, Stopped
from armdyn.optimal.bound.goal_set import is_closed
from armdyn.optimal.bound.interval import Interval, sum_down
from armdyn.optimal.bound.lattice import Lattice, Region
from armdyn.optimal.bound.leg import BoundLeg, legs_of
from armdyn.optimal.bound.leg_bound import Passage
from armdyn.optimal.bound.reach import least_time
from armdyn.optimal.bound.region import BoundRegion
from armdyn.optimal.path_constraints.frame_limits import FrameRegion
from armdyn.optimal.path_constraints.registry import path_constraints_of
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem
from armdyn.optimal.task.policy.bound import BoundPolicy
from armdyn.reprs import brief


@brief
@dataclass(frozen=True, eq=False)
class ChainBound:
    """Lower bound on the sum of the durations of consecutive motions, proven by interval arithmetic.

    Attributes:
        duration: lower bound [s].
        kinematic: bound by limits of single joints alone [s].
        legs: bounds of the problems' motions between the deciding boxes [s], with a sum of at most `duration`. Between
            other boxes a motion may be shorter, and others then longer.
        stops: middles of the deciding boxes [rad or m], shape (problems + 1, nv).
        boxes: number of boxes that enclose each stop's joint positions reachable in time.
    """

    duration: float
    kinematic: float
    legs: tuple[float, ...]
    stops: Array
    boxes: tuple[int, ...]


def chain_bound(
    problems: Sequence[MinimumTimeProblem],
    stops: Sequence[ArrayLike | str | GoalPose],
    upper: float | None = None,
    effort: Effort | None = None,
    policy: BoundPolicy | None = None,
) -> ChainBound | None:
    """Prove a lower bound on the sum of the durations of motions, each starting where the one before ends.

    Example: `chain_bound([to_bin, back], [home, ad.GoalPose("tool", bin), home], upper=1.83).duration`

    With one problem and a goal pose at both ends the bound holds for motions between any joint positions of the two, as
    needed for orders of many stops.

    Args:
        problems: one per motion: its robot with its payload, limits, path constraints, velocities at both ends
            and via points. The problems' own starts and goals are ignored.
        stops: one more than problems: joint positions, a pose's name, or a `GoalPose` for all joint positions within
            the limits that reach it.
        upper: duration of a known chain [s]: the bound is at most this, and improved until nearly equal. None: inverse
            kinematics are sampled for a chain.
        effort: budget of work; when it is spent, the bound so far is returned. None: the policy's, in this process.
        policy: tuned numbers; None: the defaults. The bound is valid for any.

    Returns:
        None if nothing is proven, as without a velocity limit of any moving joint.

    Raises:
        ProblemError: no problem, a wrong number of stops, or a pose out of reach.
        BridgeError: the dynamics have an operation without an interval extension.
    """
    numbers = policy or BoundPolicy()
    given = [expect_problem(problem) for problem in several(problems, "problems")]
    if not given or len(stops) != len(given) + 1:
        raise ProblemError(f"{len(given)} problems and {len(stops)} stops: give a problem at least, and one stop more")
    places = [
        place if isinstance(place, GoalPose) else pose_given(given[max(k - 1, 0)].robot, place, f"stops[{k}]")
        for k, place in enumerate(stops)
    ]
    longest = np.inf if upper is None else number(upper, "upper", sign="positive")
    vias = [[_via(problem, widest) for problem in given] for widest in (0.0, numbers.passed)]
    if vias[0] == vias[1]:
        vias.pop()  # no regions, or none that could help
    effort = Effort(numbers.chain_programs) if effort is None else effort
    found = []
    for k, via in enumerate(vias):
        with effort.shared(len(vias) - k):
            found.append(_bounded(given, via, places, longest, effort, numbers))
    return max((bound for bound in found if bound is not None), key=lambda bound: bound.duration, default=None)


def _bounded(
    problems: Sequence[MinimumTimeProblem],
    via: Sequence[Sequence[int]],
    stops: Sequence[Place],
    longest: float,
    effort: Effort,
    policy: BoundPolicy,
) -> ChainBound | None:
    """The bound of a chain, given the indices of the via points that are its places, problem by problem."""
    runs = _runs(problems, via, stops, policy)
    found = [run.least for run in runs]
    order = sorted(range(len(runs)), key=lambda k: len(runs[k].legs))  # point to point first: less time is left
    for done, k in enumerate(order):
        effort.others = sum_down([one.duration for j, one in enumerate(found) if j != k])
        with effort.shared(len(runs) - done):
            found[k] = runs[k].bounded(longest - effort.others, effort)
    return _together(found, np.cumsum([0, *(len(one) + 1 for one in via)]), longest)


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
    given = [one for one in path_constraints_of(problem) if isinstance(one, FrameRegion)]
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
    problems: Sequence[MinimumTimeProblem],
    via: Sequence[Sequence[int]],
    stops: Sequence[Place],
    policy: BoundPolicy,
) -> list[_Run]:
    """Split the chain at single joint positions."""
    legs: list[BoundLeg] = []
    passages: list[Passage | None] = []
    places = [stops[0]]
    for problem, passed, stop in zip(problems, via, stops[1:], strict=True):
        own = legs_of(problem, policy)
        begins = [own[0].start, *(replace(own[0].start, v=None) for _ in passed)]
        ends = [*(replace(own[-1].goal, v=None) for _ in passed), own[-1].goal]
        legs += [replace(own[0], start=begin, goal=end) for begin, end in zip(begins, ends, strict=True)]
        passages += _passages(problem, passed, own[0].dynamics)
        between = [problem.via_regions.get(k, problem.poses[k + 1]) for k in passed]
        places += [*between, stop]
    cuts = [k for k, place in enumerate(places) if not isinstance(place, GoalPose)]
    cuts = sorted({0, *cuts, len(legs)})
    return [_Run(tuple(legs[a:b]), tuple(places[a : b + 1]), tuple(passages[a:b])) for a, b in pairwise(cuts)]


def _together(runs: Sequence[ChainBound], at: NDArray[np.intp], longest: float) -> ChainBound | None:
    """The bound of consecutive runs, given the indices of the stops among their places."""
    duration = min(sum_down([run.duration for run in runs]), longest)
    legs = [leg for run in runs for leg in run.legs]
    places = [runs[0].stops[:1], *(run.stops[1:] for run in runs)]
    boxes = [runs[0].boxes[0], *(count for run in runs for count in run.boxes[1:])]
    bound = ChainBound(
        duration=duration,
        kinematic=min(sum_down([run.kinematic for run in runs]), duration),
        legs=tuple(sum_down(legs[a:b]) for a, b in pairwise(at)),
        stops=np.concatenate(places)[at],
        boxes=tuple(boxes[k] for k in at),
    )
    return bound if duration > 0 else None


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
    def least(self) -> ChainBound:
        """Bound of the run by the velocity limits alone, for points as first and last place."""
        first, last = self.places[0], self.places[-1]
        count, duration = len(self.legs), 0.0
        if not (isinstance(first, GoalPose) or isinstance(last, GoalPose)):
            fastest = np.max([leg.velocity for leg in self.legs], axis=0)
            duration = float(least_time(Interval.at(first), Interval.at(last), fastest))
        nowhere = np.full((count + 1, self.legs[0].dynamics.nv), np.nan)
        return ChainBound(duration, duration, (0.0,) * count, nowhere, (0,) * (count + 1))

    def bounded(self, longest: float, effort: Effort) -> ChainBound:
        """Lower bound of this run, for motions of at most a duration [s]; infinite if that is unknown."""
        policy = self.legs[0].policy
        if len(self.legs) > 1 or any(isinstance(place, GoalPose) for place in self.places):
            longest = min(longest, self._sampled(effort)) if np.isinf(longest) else longest
        try:
            layers = covers(self.legs, self.places, longest, effort.stop)
            lattice = Lattice(self.legs, layers, self.passages, effort.stop)
        except Stopped:
            return self.least
        boxes, first = tuple(len(layer) for layer in lattice.layers), lattice.path()
        path = lattice.improve(longest * (1 - policy.near_enough), effort)
        if first is None or path is None:  # no chain is that fast
            return replace(self.least, duration=longest, boxes=boxes)
        with np.errstate(invalid="ignore"):  # any point of an infinite box
            stops = np.array([region.hull.centre for region in path.regions])
        return ChainBound(min(path.duration, longest), min(first.duration, longest), path.legs, stops, boxes)

    def _sampled(self, effort: Effort) -> float:
        """The bound of a chain through sampled joint positions [s]: an upper bound of the one over all chains."""
        layers: list[list[Region]] = []
        points = [np.asarray(place) for place in self.places if not isinstance(place, GoalPose)]
        near = points[0] if points else self.legs[0].start.q.lower
        for k, place in enumerate(self.places):
            leg, found = self.legs[max(k - 1, 0)], [np.asarray(place)]
            if isinstance(place, GoalPose):
                found = poses_reaching(leg.dynamics.robot, place, near, leg.torque)
            layers.append([Region.point(q) for q in found])
            near = found[0]
        path = Lattice(self.legs, layers).path()
        if path is None:
            return np.inf
        legs = [replace(leg, policy=replace(leg.policy, grids=leg.policy.sampled_grids)) for leg in self.legs]
        alone = Lattice(legs, [[region] for region in path.regions])
        edges = alone.next_edges(np.inf, effort.stop)
        alone.learn(edges, effort.spent_on(edges))
        best = alone.path()
        return np.inf if best is None else best.duration
