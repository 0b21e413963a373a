"""Graphs between the branches of a cycle's stops."""

from itertools import pairwise, product

import numpy as np

import armdyn as ad
from armdyn.cycle.graph import CycleGraph
from armdyn.cycle.stops import candidates
from armdyn.models.scene.reaching import frame_placement
from cycles import planar


def test_the_promising_tours_are_the_shortest_through_each_branch_of_a_stop():
    graph = CycleGraph.of(planar())
    free = next(k for k, each in enumerate(graph.positions) if len(each) > 1)
    tours = list(product(*(range(len(each)) for each in graph.positions)))
    if graph.cycle.closed:
        tours = [tour for tour in tours if tour[0] == tour[-1]]

    def length(tour):
        return sum(graph.lengths[k, k][i, j] for k, (i, j) in enumerate(pairwise(tour)))

    best = [min(map(length, (one for one in tours if one[free] == k))) for k in range(len(graph.positions[free]))]
    found = graph._promising()
    assert len(found) == len(best) > 1
    np.testing.assert_allclose([length(tour) for tour in found], sorted(best), rtol=1e-12)


def test_a_redundant_arms_stops_get_branches_with_which_the_tour_is_shorter():
    """RRR reaches a position with a curve of joint positions, along which the stops of the best tours are slid."""
    robot, places = ad.Robot.from_spec(ad.ArmSpec.paper("rrr")), [(0.1, 0.0, 0.05), (-0.05, 0.0, 0.1)]
    steps = [ad.Move(ad.GoalPose(robot.tip, place)) for place in places]
    cycle = ad.Cycle(robot, start=[0.1, 0.2, 0.3], steps=steps, closed=True)
    sampled = CycleGraph.between(cycle, candidates(cycle))
    graph = CycleGraph.of(cycle)
    assert graph.best(graph.lengths).length < 0.99 * sampled.best(sampled.lengths).length
    for place, before, after in zip(places, sampled.positions[1:3], graph.positions[1:3], strict=True):
        assert len(after) > len(before)
        for q in after:
            np.testing.assert_allclose(frame_placement(robot, robot.tip, q).translation, place, atol=1e-9)
