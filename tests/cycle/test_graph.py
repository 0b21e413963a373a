"""Graphs between the branches of a cycle's stops."""

from itertools import pairwise, product

import numpy as np

from armdyn.cycle.graph import CycleGraph
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
