"""Courses: polynomials by hand, jumps where others switch, freedom that changes nothing."""

import numpy as np

from armdyn.optimal.switching.extremal.change import SingularControl

S = np.linspace(0, 1, 5)
SIGNS = np.array([[0.0, sign] for sign in (1, 1, -1, -1, 0)])
GIVEN = SingularControl((1.0, 2.0, 4.0), ((1, (0.5, 3.0)),))


def test_it_is_a_polynomial_and_another_limits_share():
    x = 2 * S - 1
    smooth = 1 + 2 * x + 4 * (3 * x**2 - 1) / 2
    np.testing.assert_allclose(GIVEN.terms(S, SIGNS)[0] @ GIVEN.values, smooth + SIGNS[:, 1] * (0.5 + 3 * x))


def test_its_slope_is_a_difference():
    small = 1e-6
    there, here = (GIVEN.terms(S + by, SIGNS)[0] @ GIVEN.values for by in (small, -small))
    np.testing.assert_allclose(GIVEN.terms(S, SIGNS)[1] @ GIVEN.values, (there - here) / (2 * small), rtol=1e-8)


def test_more_freedom_changes_nothing_yet():
    longer = GIVEN.longer(2, frozenset({0, 1}))
    assert longer == SingularControl((1.0, 2.0, 4.0, 0.0, 0.0), ((0, (0.0, 0.0)), (1, (0.5, 3.0, 0.0, 0.0))))
    assert longer.size == 11
    np.testing.assert_allclose(longer.terms(S, SIGNS)[0] @ longer.values, GIVEN.terms(S, SIGNS)[0] @ GIVEN.values)
    np.testing.assert_allclose(longer.terms(S, SIGNS)[1] @ longer.values, GIVEN.terms(S, SIGNS)[1] @ GIVEN.values)


def test_other_values_stand_where_these_did():
    assert GIVEN.with_values(GIVEN.values) == GIVEN
    assert GIVEN.with_values(np.arange(5.0)) == SingularControl((0.0, 1.0, 2.0), ((1, (3.0, 4.0)),))
