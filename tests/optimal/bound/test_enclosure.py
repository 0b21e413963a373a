"""Intervals, functions and affine forms over boxes contain the exact results: fractions, the Functions, Pinocchio."""

from fractions import Fraction
from math import pi

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from armdyn.dynamics import Dynamics
from armdyn.errors import BridgeError
from armdyn.optimal.bound.enclosure import EnclosedFunction, Interval, joined, terms_over
from optimal.bound.arms import ARMS, drawn

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


def in_ends(*ends):
    """A box, and a point in it."""
    lower, upper = np.array([sorted(pair[:2]) for pair in ends]).T
    shares = np.array([share for _, _, share in ends])
    return Interval(lower[:, None], upper[:, None]), np.clip(lower + shares * (upper - lower), lower, upper)


@given(ENDS, ENDS)
def test_forms_of_sums_and_products_hold_the_exact_result(first, second):
    """Against fractions, which do not round."""
    box, point = in_ends(first, second)
    x, y = map(Fraction, point)
    exact = x + y, x - y, x * y, x * x, -x, 2 * y
    for found in (SUMS.over(box), SUMS.forms(box).interval):
        for lower, value, upper in zip(found.lower[:, 0], exact, found.upper[:, 0], strict=True):
            assert Fraction(lower) <= value <= Fraction(upper)
    tight = SUMS.over(Interval(point[:, None], point[:, None]))
    assert np.all(tight.upper - tight.lower <= 1e-15 * tight.magnitude + 1e-320)  # four units in the last place


@given(ENDS)
def test_waves_hold_their_values(ends):
    box, (x, _) = in_ends(ends, ends)
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


PINOCCHIO = 1e-11
"""Of Pinocchio's own numbers, in kg m² and N m: some hundred operations on numbers below a hundred."""


@pytest.mark.parametrize("arm", ARMS)
@pytest.mark.parametrize("radius", [0.0, 0.01, 0.3])
def test_terms_contain_pinocchios_values(arm, radius):
    robot = ARMS[arm]()
    model, dynamics, rng = robot.model, Dynamics(robot), np.random.default_rng(0)
    middle = rng.uniform(-1.5, 1.5, (5, robot.nv))
    boxes = Interval(middle - radius, middle + radius)
    terms = terms_over(dynamics, boxes)
    q_symbol = ca.SX.sym("q", robot.nv)
    slope = ca.Function("slope", [q_symbol], [ca.jacobian(ca.vec(dynamics.crba(q_symbol)), q_symbol)])
    rows, columns = np.tril_indices(robot.nv)
    for _ in range(40):
        q = drawn(rng, boxes)
        share = (q - boxes.centre) / np.where(boxes.radius > 0, boxes.radius, 1.0)
        for i in range(len(q)):
            full = robot.configuration(q[i])
            inertia = np.array(pin.crba(model, model.createData(), full))
            inertia = np.triu(inertia) + np.triu(inertia, 1).T
            gravity = pin.computeGeneralizedGravity(model, model.createData(), full)
            inertia_derivatives = np.array(slope(q[i])).reshape(robot.nv, robot.nv, robot.nv)
            linear = np.einsum("kab,k->ab", terms.inertia_gradient[i].lower, share[i])
            fall = np.einsum("ka,k->a", terms.gravity_gradient[i].lower, share[i])
            for part, value in (
                (terms.inertia[i], inertia - linear),
                (terms.gravity[i], gravity - fall),
                (terms.inertia_derivatives[i], inertia_derivatives[rows, columns]),
            ):
                assert np.all(part.lower <= value + PINOCCHIO) and np.all(value <= part.upper + PINOCCHIO)
