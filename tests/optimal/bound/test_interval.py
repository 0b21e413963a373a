"""Interval operations contain the exact results: sums and products against fractions, which do not round."""

from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from armdyn.optimal.bound.interval import Interval, joined

NUMBERS = st.floats(-1e3, 1e3, allow_subnormal=False)
PAIRS = st.tuples(NUMBERS, NUMBERS, st.floats(0, 1))


def of(pair):
    """An interval of one place, and a number in it."""
    a, b, share = pair
    lower, upper = min(a, b), max(a, b)
    return Interval(np.array([lower]), np.array([upper])), min(max(lower + share * (upper - lower), lower), upper)


def holds(interval, exact):
    """An exact number is within the one interval."""
    return Fraction(interval.lower.item()) <= exact <= Fraction(interval.upper.item())


@given(PAIRS, PAIRS)
def test_sums_and_products_hold_the_exact_result(first, second):
    (a, x), (b, y) = of(first), of(second)
    x, y = Fraction(x), Fraction(y)
    assert holds(a + b, x + y)
    assert holds(a - b, x - y)
    assert holds(a * b, x * y)
    assert holds(-a, -x)
    if b.mignitude.item() > 1e-3:
        assert holds(a / b, x / y)


@given(st.lists(PAIRS, min_size=3, max_size=3), st.lists(PAIRS, min_size=3, max_size=3))
def test_matrix_products_and_running_sums_hold_the_exact_result(first, second):
    rows, xs = zip(*(of(pair) for pair in first), strict=True)
    columns, ys = zip(*(of(pair) for pair in second), strict=True)
    row, column = joined(rows).shaped((1, 3)), joined(columns).shaped((3, 1))
    assert holds(row.dot(column), sum(Fraction(x) * Fraction(y) for x, y in zip(xs, ys, strict=True)))
    weights = np.array(ys).reshape(3, 1)
    assert holds(row.times(weights), sum(Fraction(x) * Fraction(y) for x, y in zip(xs, ys, strict=True)))
    assert holds(row.sum(1), sum(map(Fraction, xs)))
    running = joined(rows).running()
    for count in range(4):
        assert holds(running[count], sum(map(Fraction, xs[:count]), Fraction(0)))


@given(st.lists(PAIRS, min_size=4, max_size=4), st.lists(PAIRS, min_size=3, max_size=3))
def test_boxes_that_ways_lead_to_hold_them_exactly_and_are_no_wider(boxes, ways):
    """Against box by box: as far as the way leads from the box before, and within the box itself."""
    boxes, ways = (joined([of(pair)[0] for pair in some]) for some in (boxes, ways))
    found, (lower, upper) = boxes.propagated(ways), (Fraction(end[0]) for end in (boxes.lower, boxes.upper))
    for k, (low, high) in enumerate(zip(ways.lower, ways.upper, strict=True), start=1):
        lower, upper = lower + Fraction(low), upper + Fraction(high)
        lower, upper = max(lower, Fraction(boxes.lower[k])), min(upper, Fraction(boxes.upper[k]))
        assert found.lower[k] <= lower and upper <= found.upper[k]
        assert lower - Fraction(found.lower[k]) < 1e-10 and Fraction(found.upper[k]) - upper < 1e-10


@given(PAIRS)
def test_hyperbolic_tangents_hold_their_values(pair):
    interval, x = of(pair)
    found = interval.tanh()
    assert -1 <= found.lower.item() <= np.tanh(x) <= found.upper.item() <= 1


def test_the_intersection_is_never_empty():
    beside = Interval(np.array([0.0]), np.array([1.0])).meet(Interval(np.array([1.5]), np.array([2.0])))
    assert beside.lower.item() <= beside.upper.item()


def test_centre_and_radius_hold_the_ends():
    interval = Interval(np.array([0.1, -3.0, 2.0]), np.array([0.30000000000000004, 7.0, 2.0]))
    assert np.all(interval.centre - interval.radius <= interval.lower)
    assert np.all(interval.centre + interval.radius >= interval.upper)
    assert interval.radius[2] == 0
