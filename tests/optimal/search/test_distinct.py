"""Which of many answers are one optimum."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.optimal.search.distinct import distinct, grouped, ranked, within
from armdyn.optimal.solve.attempt import Attempt

STATUSES = st.sampled_from([ad.Status.SOLVED, ad.Status.SOLVED, ad.Status.FAILED, ad.Status.ITERATION_LIMIT])


def attempt(duration, status=ad.Status.SOLVED, intervals=15, q=0.0):
    motion = ad.Trajectory([0, duration], np.full((2, 1), q), np.zeros((2, 1)), np.zeros((2, 1)))
    return Attempt(status, "", motion, intervals, 1, None)


def durations(attempts):
    return [a.trajectory.duration for a in attempts]


ATTEMPTS = st.lists(st.builds(attempt, st.floats(0.1, 10), STATUSES, st.sampled_from([15, 25])), max_size=30)


@given(st.lists(st.floats(0.1, 10)), st.floats(0, 0.5))
def test_groups_lose_none_and_hold_those_like_their_first(numbers, same):
    alike = within(same)
    groups = grouped(sorted(numbers), alike)
    assert [number for group in groups for number in group] == sorted(numbers)
    assert all(alike(group[0], number) for group in groups for number in group)
    assert all(not alike(before[0], after[0]) for before, after in pairwise(groups))


@given(ATTEMPTS)
def test_ranked_loses_none_and_puts_converged_ones_first(attempts):
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


@given(ATTEMPTS)
def test_motions_that_are_alike_differ_by_their_durations_alone(attempts):
    assert distinct(attempts, 0.01, apart=0.3) == distinct(attempts, 0.01)


def test_of_one_duration_motions_far_apart_are_two_optima():
    attempts = [attempt(1.0), attempt(1.0005, q=0.5), attempt(1.001, q=0.4)]
    assert durations(distinct(attempts, 2e-3)) == [1.0]
    assert durations(distinct(attempts, 2e-3, apart=0.3)) == [1.0, 1.0005]
