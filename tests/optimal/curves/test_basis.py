"""B-splines on a graded mesh: against SciPy's, against polynomials, and by their definition."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from armdyn.optimal.curves.basis import DEGREE, Basis, graded

MESHES = st.builds(graded, st.integers(1, 30), st.floats(1e-4, 1.0))
PARTS = st.lists(st.floats(0, 1), min_size=1, max_size=8).map(np.array)


@given(MESHES, PARTS)
def test_local_values_and_derivatives_make_the_curve(breaks, s):
    basis = Basis(breaks)
    points = np.random.default_rng(basis.size).normal(size=(basis.size, 2))
    curve, window = BSpline(basis.knots, points, DEGREE), basis.interval_of(s)[:, None] + np.arange(DEGREE + 1)
    local = basis.local(s)
    for order in range(3):
        expected = curve(s, order)
        # Rounding of sums of five products; derivatives grow by 4 over the shortest interval.
        scale = np.max(np.abs(local[:, order])) * np.max(np.abs(points))
        assert np.max(np.abs(np.einsum("mw,mwj->mj", local[:, order], points[window]) - expected)) <= 1e-12 * scale
    np.testing.assert_allclose(local[:, 0].sum(axis=1), 1, atol=1e-14)  # rounding of five numbers below one
    assert np.all(local[:, 0] >= 0)
    np.testing.assert_array_equal(basis.curve(points)(s), curve(s))


@given(MESHES, st.integers(1, 3))
def test_factors_make_the_control_points_of_a_derivative(breaks, order):
    basis = Basis(breaks)
    points = np.random.default_rng(order).normal(size=basis.size)
    derived = points
    for k in range(1, order + 1):
        derived = basis.factors(k) * np.diff(derived)
    inner = BSpline(basis.knots[order:-order], derived, DEGREE - order)
    s = np.linspace(0, 1, 37)[1:-1]  # a third derivative is linear between breaks and jumps there
    s = s[np.min(np.abs(s[:, None] - breaks), axis=1) > 1e-6]
    expected = basis.curve(points)(s, order)
    # Both lose an ulp or so of the largest control point at each difference.
    np.testing.assert_allclose(inner(s), expected, atol=1e-13 * max(1.0, float(np.max(np.abs(derived)))))


@given(st.integers(1, 60), st.floats(1e-5, 0.2))
def test_a_graded_mesh_is_symmetric_and_its_ends_are_as_short_as_requested(intervals, shortest):
    lengths = np.diff(graded(intervals, shortest))
    assert lengths.size == intervals and np.all(lengths > 0)
    np.testing.assert_allclose(lengths, lengths[::-1], rtol=1e-9)  # differences of breaks near one, ulp / 1e-5
    assert graded(intervals, shortest)[-1] == 1.0
    if intervals * shortest < 1 and intervals > 2:
        assert lengths[0] == pytest.approx(shortest, rel=1e-9)  # of brentq, 2e-12 in the growth; ulp / 1e-5
        half = lengths[: (intervals + 1) // 2]
        growth = half[1:] / half[:-1]
        np.testing.assert_allclose(growth, growth[0] if growth.size else 1, rtol=1e-9)  # one factor, as above
        assert np.all(growth >= 1)
    else:  # as short as they come
        np.testing.assert_allclose(lengths, 1 / intervals, rtol=1e-12)


@given(MESHES)
def test_control_points_on_a_line_over_their_places_make_that_line(breaks):
    basis = Basis(breaks)
    s = np.linspace(0, 1, 101)
    np.testing.assert_allclose(basis.curve(3 - 2 * basis.places)(s), 3 - 2 * s, atol=1e-14)  # a few ulp of three
    assert basis.places[0] == 0 and basis.places[-1] == 1 and np.all(np.diff(basis.places) > 0)


@pytest.mark.parametrize("points", [1, 2, 3])
def test_gauss_integrates_the_polynomials_of_its_degree(points):
    basis = Basis(graded(7, 0.01))
    s, weights = basis.gauss(points)
    assert s.shape == weights.shape == (7, points)
    for power in range(2 * points):
        # Rounding of 21 positive numbers.
        assert np.sum(weights * s**power) == pytest.approx(1 / (power + 1), rel=1e-14)
    assert np.sum(weights * s ** (2 * points)) != pytest.approx(1 / (2 * points + 1), rel=1e-12)


def test_every_place_lies_in_its_interval():
    breaks = graded(5, 0.05)
    basis = Basis(breaks)
    np.testing.assert_array_equal(basis.interval_of(breaks), [0, 1, 2, 3, 4, 4])  # the end belongs to the last
    np.testing.assert_array_equal(basis.interval_of((breaks[1:] + breaks[:-1]) / 2), np.arange(5))
    assert basis.intervals == 5 and basis.size == 9 and basis.knots.size == 14
