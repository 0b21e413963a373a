"""Guesses and bounds of the program of curves."""

import numpy as np
import pytest

from armdyn.optimal.curves.layout import TorqueMargin, curve_layout
from armdyn.optimal.curves.nlp_data import assemble_curve
from armdyn.optimal.curves.program import rows_of
from optimal.curves.bends import GOAL, KINDS, START, VIA, bent, spec, task


def nlp_data(kind, **more):
    job = task(kind)
    guess, want = bent(job.problem), spec(job.problem, **more)
    shape = curve_layout(job.problem, guess, want.constraints)
    return job, guess, shape, assemble_curve(job, guess, want, shape)


@pytest.mark.parametrize("kind", KINDS)
def test_guesses_are_within_their_bounds_and_finite(kind):
    _, _, _, numbers = nlp_data(kind)
    lower, upper = numbers.x_bounds
    assert np.all(numbers.x >= lower) and np.all(numbers.x <= upper)
    assert np.all(np.isfinite(numbers.x)) and np.all(np.isfinite(numbers.p))
    assert np.all(numbers.g_bounds[0] <= numbers.g_bounds[1])


@pytest.mark.parametrize(
    ("kind", "first", "last"),
    # Control points that are one with an end's: of the pose; and its rest; and of a torque that begins with no jump.
    [("plain", 2, 2), ("in flight", 1, 1), ("acceleration and jerk", 3, 3), ("torque rate", 3, 3)],
)
def test_control_points_at_the_ends_are_fixed(kind, first, last):
    _, _, shape, numbers = nlp_data(kind)
    lower, upper = (side[shape.points(0)] for side in numbers.x_bounds)
    fixed = np.all(lower == upper, axis=1)
    assert np.all(fixed[:first]) and np.all(fixed[-last:])
    assert not np.any(fixed[first:-last])
    np.testing.assert_array_equal(lower[:first], [START] * first)
    np.testing.assert_array_equal(upper[-last:], [GOAL] * last)


def test_a_via_point_is_an_end_of_both_legs_and_no_rest():
    _, _, shape, numbers = nlp_data("via")
    lower, upper = numbers.x_bounds
    for leg, place in ((0, -1), (1, 0)):
        points = shape.points(leg)
        np.testing.assert_array_equal(lower[points[place]], VIA)
        np.testing.assert_array_equal(upper[points[place]], VIA)
        assert np.all(lower[points[place + (1 if leg else -1)]] < upper[points[place + (1 if leg else -1)]])


def test_velocities_at_the_ends_are_equations():
    job, _, shape, numbers = nlp_data("in flight")
    rates = slice(shape.torques(0).size, shape.torques(0).size + 2 * (shape.points(0).shape[0] - 1))
    lower, upper = (side[rates].reshape(-1, 2) for side in numbers.g_bounds)
    for place, v in ((0, job.problem.v_start), (-1, job.problem.v_goal)):
        np.testing.assert_allclose(lower[place] * job.problem.limits.velocity, v, rtol=1e-15)
        np.testing.assert_array_equal(lower[place], upper[place])
    kept = 1 - job.policy.curves.velocity_error
    np.testing.assert_array_equal(upper[1:-1], kept)  # a motion in flight cannot be slowed down afterwards
    np.testing.assert_array_equal(lower[1:-1], -kept)


def test_room_is_taken_off_the_torques_limits():
    _, guess, shape, _ = nlp_data("plain")
    places = guess.legs[0].basis.intervals * 2
    upper = np.zeros((places, 2))
    upper[3, 1] = 0.2
    numbers = nlp_data("plain", margins=(TorqueMargin(upper, 0.1),))[-1]
    least, most = (side[shape.torques(0)] for side in numbers.x_bounds)
    np.testing.assert_allclose(most, 1 - upper, rtol=1e-15)
    np.testing.assert_allclose(least, -0.9, rtol=1e-15)
    assert np.all(np.abs(numbers.x[shape.torques(0)]) <= 0.9)  # cautious


def test_room_is_taken_off_the_torques_rates():
    _, guess, _, plain = nlp_data("torque rate")
    rates = np.zeros((guess.legs[0].basis.intervals * 2 + 1, 2))
    rates[4] = 0.3
    roomy = nlp_data("torque rate", margins=(TorqueMargin(rates=rates),))[-1]
    changed = np.flatnonzero(roomy.g_bounds[1] != plain.g_bounds[1])
    assert changed.size == 1  # the other joint has no limit
    assert plain.g_bounds[1][changed] == 1 and roomy.g_bounds[1][changed] == pytest.approx(0.7, rel=1e-15)
    assert roomy.g_bounds[0][changed] == pytest.approx(-0.7, rel=1e-15)


@pytest.mark.parametrize(("kind", "count"), [("acceleration and jerk", 0), ("torque rate", 0), ("frame speed", 1)])
def test_limits_kept_by_control_points_and_torques_need_no_rows(kind, count):
    job, _, shape, _ = nlp_data(kind)
    want = spec(job.problem)
    assert len(rows_of(job.problem, want.constraints)) == count
    assert shape.rated == (kind == "torque rate")
    assert shape.orders == ((1, 2, 3) if kind == "acceleration and jerk" else (1,))
    assert shape.smooth == (1 if kind == "frame speed" else 2)
