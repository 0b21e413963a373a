"""The order of jobs against all orders."""

from itertools import pairwise, permutations

import numpy as np
import pytest

from armdyn.cycle.order import best_order, order_of_many, shortest


def random_lengths(jobs, branches, seed):
    random = np.random.default_rng(seed)
    sizes = [branches] * jobs + [2]
    return [[random.random((a, b)) for b in sizes] for a in sizes]


def length_of(lengths, order, closed):
    """By all combinations of branches, one after the other."""
    places = [len(lengths) - 1, *order, len(lengths) - 1]
    return shortest([lengths[a][b] for a, b in pairwise(places)], closed)[0]


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("jobs", [1, 2, 5])
def test_the_best_order_is_the_best_of_all(jobs, closed):
    lengths = random_lengths(jobs, 3, seed=jobs)
    length, order = best_order(lengths, closed)
    least = min(length_of(lengths, each, closed) for each in permutations(range(jobs)))
    assert length == pytest.approx(least, abs=1e-12)
    assert length_of(lengths, order, closed) == pytest.approx(least, abs=1e-12)


@pytest.mark.parametrize("places", [3, 7, 9])
def test_the_integer_program_finds_the_order_that_dynamic_programming_finds(places):
    points = np.random.default_rng(places).random((places, 2))
    lengths = np.linalg.norm(points[:, None] - points[None], axis=2)
    bound, order = order_of_many(lengths)
    exact, _ = best_order([[np.array([[each]]) for each in row] for row in lengths], closed=True)
    assert sorted(order) == list(range(places - 1))
    found = sum(lengths[a, b] for a, b in pairwise([places - 1, *order, places - 1]))
    assert found == pytest.approx(exact, abs=1e-9)
    assert bound == pytest.approx(exact, rel=1e-6)


def test_forty_places_are_ordered_with_a_bound():
    points = np.random.default_rng(0).random((40, 2))
    lengths = np.linalg.norm(points[:, None] - points[None], axis=2)
    bound, order = order_of_many(lengths)
    found = sum(lengths[a, b] for a, b in pairwise([39, *order, 39]))
    assert sorted(order) == list(range(39))
    assert bound - 1e-9 <= found <= 1.05 * bound


def test_no_way_is_infinite():
    lengths = np.full((3, 3), np.inf)
    assert order_of_many(lengths)[0] == np.inf
    assert shortest([np.full((2, 2), np.inf)], closed=False)[0] == np.inf


@pytest.mark.parametrize("closed", [True, False])
def test_the_shortest_way_through_layers_is_the_shortest_of_all(closed):
    random = np.random.default_rng(3)
    lengths = [random.random((3, 4)), random.random((4, 2)), random.random((2, 3))]
    length, way = shortest(lengths, closed)
    ways = [
        (lengths[0][a, b] + lengths[1][b, c] + lengths[2][c, d], (a, b, c, d))
        for a in range(3)
        for b in range(4)
        for c in range(2)
        for d in range(3)
        if a == d or not closed
    ]
    assert length == pytest.approx(min(ways)[0], abs=1e-12)
    assert way == min(ways)[1]
