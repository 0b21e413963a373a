"""Functions in intervals and in affine forms, against the Functions themselves."""

from fractions import Fraction
from math import pi

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.errors import BridgeError
from armdyn.optimal.bound.enclosure import EnclosedFunction
from armdyn.optimal.bound.interval import Interval

X = ca.SX.sym("x", 3)
VALUES = ca.vertcat(
    ca.sin(X[0]) * ca.cos(X[1]) - X[2], 0, -(ca.sin(X[0] + X[1]) ** 2), 2.5 * X[2] + X[2], X[0] * X[1] * X[2], 7
)
FUNCTION = ca.Function("several", [X], [VALUES])
ROUNDING = 1e-14
"""Largest error of a value computed in floats: some ten operations on numbers below ten."""


@given(
    st.lists(st.floats(-3, 3), min_size=3, max_size=3),
    st.lists(st.floats(0, 1), min_size=3, max_size=3),
    st.lists(st.floats(-1, 1), min_size=3, max_size=3),
)
def test_values_are_within(middle, radius, where):
    middle, radius, where = (np.array(x)[:, None] for x in (middle, radius, where))
    box = Interval(middle - radius, middle + radius)
    x = np.clip(box.centre + where * box.radius, box.lower, box.upper)
    value = np.array(FUNCTION(x[:, 0]))
    enclosed = EnclosedFunction.of(FUNCTION)
    forms = enclosed.forms(box)
    for found in (enclosed.over(box), forms.interval):
        assert np.all(found.lower <= value + ROUNDING) and np.all(value <= found.upper + ROUNDING)
    share = np.divide(x - box.centre, box.radius, out=np.zeros_like(x), where=box.radius > 0)
    linear = forms.centre + np.einsum("pkb,kb->pb", forms.gradient, share)
    assert np.all(np.abs(value - linear) <= forms.rest + ROUNDING)


def test_the_remainder_of_affine_forms_is_of_second_order():
    enclosed = EnclosedFunction.of(FUNCTION)
    middle = np.array([[0.3], [-0.7], [1.1]])
    rests = [np.max(enclosed.forms(Interval(middle - r, middle + r)).rest) for r in (1e-2, 1e-3)]
    assert rests[0] / rests[1] == pytest.approx(100, rel=0.1)  # third order's share at 1e-2


PAIR = ca.SX.sym("x", 2)
SUMS = EnclosedFunction.of(
    ca.Function("sums", [PAIR], [ca.vertcat(PAIR[0] + PAIR[1], PAIR[0] - PAIR[1], PAIR[0] * PAIR[1], PAIR[0] ** 2,
                                            -PAIR[0], 2 * PAIR[1])])
)  # fmt: skip
WAVES = EnclosedFunction.of(ca.Function("waves", [PAIR], [ca.vertcat(ca.sin(PAIR[0]), ca.cos(PAIR[0]))]))
NUMBERS = st.floats(-1e3, 1e3, allow_subnormal=False)
ENDS = st.tuples(NUMBERS, NUMBERS, st.floats(0, 1))


def drawn(*ends):
    """A box, and a point in it."""
    lower, upper = np.array([sorted(pair[:2]) for pair in ends]).T
    shares = np.array([share for _, _, share in ends])
    return Interval(lower[:, None], upper[:, None]), np.clip(lower + shares * (upper - lower), lower, upper)


@given(ENDS, ENDS)
def test_sums_and_products_hold_the_exact_result(first, second):
    """Against fractions, which do not round."""
    box, point = drawn(first, second)
    x, y = map(Fraction, point)
    exact = x + y, x - y, x * y, x * x, -x, 2 * y
    for found in (SUMS.over(box), SUMS.forms(box).interval):
        for lower, value, upper in zip(found.lower[:, 0], exact, found.upper[:, 0], strict=True):
            assert Fraction(lower) <= value <= Fraction(upper)
    tight = SUMS.over(Interval(point[:, None], point[:, None]))
    assert np.all(tight.upper - tight.lower <= 1e-15 * tight.magnitude + 1e-320)  # four units in the last place


@given(ENDS)
def test_waves_hold_their_values(ends):
    box, (x, _) = drawn(ends, ends)
    for found in (WAVES.over(box), WAVES.forms(box).interval):
        # The library's sine is right to an ulp of 1.
        assert np.all(found.lower[:, 0] <= np.array([np.sin(x), np.cos(x)]) + 2e-16)
        assert np.all(found.upper[:, 0] >= np.array([np.sin(x), np.cos(x)]) - 2e-16)
    plain = WAVES.over(box)
    assert np.all(plain.lower >= -1) and np.all(plain.upper <= 1)


def wave(lower, upper):
    """Intervals of the sine and of the cosine."""
    found = WAVES.over(Interval(np.array([[lower], [0.0]]), np.array([[upper], [0.0]])))
    return found.lower[:, 0], found.upper[:, 0]


@pytest.mark.parametrize("turn", [0, 2 * pi, -20 * pi])
def test_extrema_within_an_interval_are_found(turn):
    (sine, cosine), most = wave(turn + pi / 2 - 0.1, turn + pi / 2 + 0.1)
    assert most[0] == 1 and sine > 0.99
    assert cosine == pytest.approx(-np.sin(0.1), abs=1e-12)
    least, most = wave(turn + pi - 0.1, turn + pi + 0.1)
    assert least[1] == -1 and most[1] < -0.99
    least, most = wave(turn, turn + 2 * pi)
    assert np.all(least == -1) and np.all(most == 1)
    assert wave(0.0, pi / 2)[1][0] == 1  # the float lies 6e-17 before the extremum
    assert wave(-0.5, 0.0)[1][1] == 1


@pytest.mark.parametrize("boxes", [1, 3, 4, 9])
def test_boxes_do_not_touch_each_other(boxes):
    """However many are evaluated side by side."""
    rng, enclosed = np.random.default_rng(4), EnclosedFunction.of(FUNCTION)
    middle = rng.uniform(-2, 2, (3, boxes))
    box = Interval(middle - 0.1, middle + 0.2)
    whole, forms = enclosed.over(box), enclosed.forms(box)
    for k in range(boxes):
        alone, form = enclosed.over(box[:, k : k + 1]), enclosed.forms(box[:, k : k + 1])
        np.testing.assert_array_equal(whole.lower[:, k], alone.lower[:, 0])
        np.testing.assert_array_equal(whole.upper[:, k], alone.upper[:, 0])
        for many, one in zip(forms.parts, form.parts, strict=True):
            np.testing.assert_array_equal(many[..., k], one[..., 0])


def test_an_overflow_is_enclosed_by_infinity():
    huge = Interval(np.full((2, 1), 1e200), np.full((2, 1), 2e200))
    found, form = SUMS.over(huge), SUMS.forms(huge)
    for product in (2, 3):
        assert found.lower[product, 0] == -np.inf and found.upper[product, 0] == np.inf
        assert form.centre[product, 0] == 0 and form.rest[product, 0] == np.inf
    assert found.lower[0, 0] <= 2e200 <= 4e200 <= found.upper[0, 0] < np.inf


def test_an_unknown_operation_is_refused():
    with pytest.raises(BridgeError, match="not known"):
        EnclosedFunction.of(ca.Function("root", [X], [ca.sqrt(X)]))


def test_other_functions_are_refused():
    y = ca.MX.sym("y", 2)
    with pytest.raises(BridgeError, match="SX"):
        EnclosedFunction.of(ca.Function("other", [y], [2 * y]))
