"""When enough guesses have been solved, and which of their optima are different."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.optimal.search.distinct import distinct, ranked
from armdyn.optimal.search.multistart import enough
from armdyn.optimal.solve.attempt import Attempt

STATUSES = st.sampled_from([ad.Status.SOLVED, ad.Status.SOLVED, ad.Status.FAILED, ad.Status.ITERATION_LIMIT])


def attempt(duration, status=ad.Status.SOLVED, intervals=15):
    motion = ad.Trajectory([0, duration], np.zeros((2, 1)), np.zeros((2, 1)), np.zeros((2, 1)))
    return Attempt(status, "", motion, intervals, 1, None)


def durations(attempts):
    return [a.trajectory.duration for a in attempts]


ATTEMPTS = st.lists(st.builds(attempt, st.floats(0.1, 10), STATUSES, st.sampled_from([15, 25])), max_size=30)


@pytest.mark.parametrize(("optima", "guesses"), [(1, 7), (2, 16), (3, 29), (4, 46), (5, 67)])
def test_enough_guesses_by_the_rule(optima, guesses):
    """W (n - 1) / (n - W - 2) <= W + 1/2 is n >= 2 W² + 3 W + 2."""
    assert guesses == 2 * optima**2 + 3 * optima + 2
    assert not enough(guesses - 1, optima) and enough(guesses, optima)


@given(st.integers(0, 200), st.integers(1, 40))
def test_who_has_enough_has_enough_of_more_and_for_fewer(solved, optima):
    if enough(solved, optima):
        assert enough(solved + 1, optima)
        assert optima == 1 or enough(solved, optima - 1)


@given(ATTEMPTS)
def test_ranked_loses_none_and_puts_what_converged_first(attempts):
    order = ranked(attempts)
    assert sorted(map(id, order)) == sorted(map(id, attempts))
    converged = [a.status is ad.Status.SOLVED for a in order]
    assert converged == sorted(converged, reverse=True)
    assert durations(order[: sum(converged)]) == sorted(durations(order[: sum(converged)]))


@given(ATTEMPTS)
def test_distinct_ones_converged_and_all_that_did_are_near_one_of_them(attempts):
    same = 0.01
    kept = distinct(attempts, same)
    assert all(a.status is ad.Status.SOLVED for a in kept)
    solved = [a for a in attempts if a.status is ad.Status.SOLVED]
    assert bool(kept) == bool(solved)
    # A group reaches `same` beyond its best, and the finest mesh's speaks for it.
    assert all(b > a for a, b in pairwise(durations(kept)))
    assert all(any(abs(d / k - 1) <= 2.1 * same for k in durations(kept)) for d in durations(solved))
    if solved:
        assert kept[0].trajectory.duration <= min(durations(solved)) * (1 + same)
    assert len(distinct(kept, 0.0)) == len(kept)


def test_distinct_keeps_the_best_of_each():
    found = distinct([attempt(1.0), attempt(1.001), attempt(1.1), attempt(2.0, ad.Status.FAILED)], 2e-3)
    assert durations(found) == [1.0, 1.1]


def test_the_finer_mesh_speaks_for_an_optimum():
    found = distinct([attempt(1.0), attempt(1.001, intervals=25), attempt(1.1)], 2e-3)
    assert [a.intervals for a in found] == [25, 15]
