"""Lower bound on a cycle whose jobs may be done in any order, over all joint positions that reach its goal poses.

Boxes enclose the joint positions of every stop, and each move between two stops has the least bound between any of
their boxes. No cycle is shorter than the best order by these, whatever branches it goes through. Bounds of the moves of
the best order are improved, until it is long enough.
"""

from dataclasses import replace

import numpy as np

from armdyn.cycle.graph import Arc, CycleGraph
from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.bound.chain import covers
from armdyn.optimal.bound.lattice import Effort, Lattice, Region, Stopped
from armdyn.optimal.bound.leg import BoundLeg, bound_legs
from armdyn.optimal.problem.policy.bound import BoundPolicy


def order_bound(graph: CycleGraph, enough: float, effort: Effort) -> float:
    """Lower bound on the time of all moves in any order [s]; 0 if none is known.

    Args:
        graph: graph of a cycle in free order.
        enough: duration of all moves of a cycle that is known [s]: the bound is no more than that.
        effort: budget of the proof.
    """
    legs = _legs(graph)
    if legs is None:
        return 0.0
    try:
        stops = _regions(graph, legs, enough, effort)
    except Stopped:
        return 0.0
    lattices = {arc: Lattice([leg], [stops[arc[0]], stops[arc[1] + 1]]) for arc, leg in legs.items()}
    least = {arc: np.inf if (path := own.path()) is None else path.duration for arc, own in lattices.items()}
    left = set(lattices)
    while True:
        lengths = {arc: np.full(own.shape, least[arc]) for arc, own in graph.lengths.items()}
        tour = graph.best(lengths)
        arcs = [edge[:2] for edge in tour.edges if edge[:2] in left]
        if not effort or tour.length >= enough or not arcs:
            return min(graph.bound(lengths), enough)
        effort.report_bound(tour.length)
        edges = {arc: lattices[arc].next_edges(enough, effort.stop) for arc in arcs}
        found = iter(effort.spent_on([edge for own in edges.values() for edge in own]))
        for arc, own in edges.items():
            lattices[arc].learn(own, [next(found) for _ in own])
            path = lattices[arc].path()
            least[arc] = np.inf if path is None else path.duration
            if not own:
                left.discard(arc)  # no other boxes are nearer, and these are bounded as well as can be


def _legs(graph: CycleGraph) -> dict[Arc, BoundLeg] | None:
    """The leg of every arc, between any of its ends; None: one of them poses no problem."""
    found = {}
    for arc, own in graph.lengths.items():
        edges = ((*arc, i, j) for i, j in np.ndindex(own.shape))
        problem = next((posed for edge in edges if (posed := graph.problem(edge)) is not None), None)
        if problem is None:
            return None
        found[arc] = bound_legs(problem, replace(BoundPolicy(), at_once=1))[0]
    return found


def _regions(graph: CycleGraph, legs: dict[Arc, BoundLeg], longest: float, effort: Effort) -> list[list[Region]]:
    """Regions of every stop: those that are reached from the start in some time [s]."""
    start = graph.cycle.stops[0].target
    ends = [] if isinstance(start, GoalPose) else [start]
    found = []
    for k, place in enumerate(graph.cycle.stops):
        own = next(leg for arc, leg in legs.items() if k in (arc[0], arc[1] + 1))
        places = [*ends, place.target, *(ends if graph.cycle.closed else [])]
        layers = covers([own] * max(len(places) - 1, 1), places, longest, effort.stop)
        found.append(layers[len(ends)])
    return found
