"""Curves and their B-splines: their ends, torques and pace; against SciPy's, polynomials, and by definition."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

import armdyn as ad
from armdyn.optimal.curves.curve import DEGREE, Basis, Curve, CurveLeg, graded
from armdyn.trajectory import Trajectory
from optimal.curves.bends import GOAL, START, VIA, bent, problem

S = np.linspace(0, 1, 23)


def test_velocity_and_acceleration_are_derivatives_by_time():
    (leg,) = bent(problem("plain")).legs
    step = 1e-5
    inner = S[1:-1]
    (before, v_before, _), (after, v_after, _) = leg.at(inner - step), leg.at(inner + step)
    _, v, a = leg.at(inner)
    h = 2 * step * leg.duration
    # Central differences: the third derivative times h²/6 and rounding over h, each 1e-8 or so of some hundred.
    np.testing.assert_allclose((after - before) / h, v, atol=1e-6 * np.max(np.abs(a)))
    np.testing.assert_allclose((v_after - v_before) / h, a, atol=1e-5 * np.max(np.abs(a)))


def test_torques_are_pinocchios_and_frictions():
    nlp_data = problem("friction")
    robot = nlp_data.robot
    (leg,) = bent(nlp_data).legs
    data, friction = robot.model.createData(), robot.friction
    for q, v, a, tau in zip(*leg.at(S), leg.torques(robot, S), strict=True):
        rubbing = friction.damping * v + friction.coulomb * np.tanh(v / friction.width)
        bare = pin.rnea(robot.model, data, q, v, a)
        np.testing.assert_allclose(tau, bare + rubbing, rtol=1e-12, atol=1e-12)  # rounding of a sum


def test_at_a_slower_pace_other_torques_than_gravity_fall_by_the_square():
    nlp_data = problem("plain")
    robot, curve = nlp_data.robot, bent(nlp_data)
    slow = curve.slower(3.0)
    data = robot.model.createData()
    (leg,), (slow_leg,) = curve.legs, slow.legs
    gravity = np.array([pin.computeGeneralizedGravity(robot.model, data, q) for q in leg.at(S)[0]])
    moving, slowly = leg.torques(robot, S) - gravity, slow_leg.torques(robot, S) - gravity
    # Without friction inertia and Coriolis forces are quadratic in rates: rounding remains.
    np.testing.assert_allclose(9 * slowly, moving, atol=1e-12 * np.max(np.abs(moving)))
    assert slow.duration == 3 * curve.duration
    np.testing.assert_array_equal(leg.at(S)[0], slow_leg.at(S)[0])


@pytest.mark.parametrize("kind", ["plain", "via"])
def test_a_straight_curve_goes_from_pose_to_pose_on_lines(kind):
    nlp_data = problem(kind)
    curve = Curve.straight(nlp_data, Basis(graded(12, 0.01)), 1.2 * nlp_data.leg_bounds())
    assert len(curve.legs) == len(nlp_data.poses) - 1
    for leg, a, b, least in zip(
        curve.legs, nlp_data.poses[:-1], nlp_data.poses[1:], nlp_data.leg_bounds(), strict=True
    ):
        q, v, _ = leg.at(S)
        np.testing.assert_allclose(q[[0, -1]], [a, b], rtol=0, atol=1e-15)  # an ulp, by SciPy's de Boor
        part = (q - a) @ (b - a) / np.sum((b - a) ** 2)
        np.testing.assert_allclose(q, a + part[:, None] * (b - a), atol=1e-14)  # rounding of numbers near one
        assert np.all(np.diff(part) > 0)
        assert np.max(np.abs(v[0])) < np.max(np.abs(v[11])) / 2  # it gains speed first
        assert leg.duration == pytest.approx(1.2 * least)
        assert np.all(
            np.abs(v) <= nlp_data.limits.velocity
        )  # 1.2 times the least time, cruising at 1 / 0.9 of the mean
    assert curve.passing.size == len(curve.legs) - 1


def test_a_straight_curve_takes_the_time_that_is_given():
    nlp_data = ad.MinimumTimeProblem(problem("plain").robot, q_start=START, q_goal=GOAL, velocity_limit=np.inf)
    assert Curve.straight(nlp_data, Basis(graded(4, 1.0)), 0.7).duration == 0.7


def motion():
    """Some motion over START, VIA and GOAL; VIA at half the time."""
    t = np.linspace(0, 0.6, 61)
    part = (t / 0.6)[:, None]
    start, via, goal = map(np.array, (START, VIA, GOAL))
    q = start * (1 - part) * (1 - 2 * part) + 4 * via * part * (1 - part) + goal * part * (2 * part - 1)
    return Trajectory(t, q, np.gradient(q, t, axis=0), np.zeros_like(q))


def test_a_curve_near_a_motion_begins_and_ends_where_it_does():
    basis, spec = Basis(graded(40, 1.0)), motion()
    curve = Curve.from_motion(spec, basis)
    assert curve.duration == spec.duration and curve.passing.size == 0
    (whole,) = curve.legs
    # A curve is off its control points by about q'' h²: 20 of (1/40)².
    np.testing.assert_allclose(whole.at(S)[0], spec(0.6 * S).q, atol=20 / 40**2)
    np.testing.assert_allclose(whole.at(S)[0][[0, -1]], spec.q[[0, -1]], rtol=0, atol=1e-15)  # an ulp


def test_samples_are_the_curves_and_as_many_as_requested():
    nlp_data = problem("via")
    curve = bent(nlp_data)
    samples = curve.trajectory(nlp_data.robot, [3, 10])
    assert np.count_nonzero(samples.jumps) == 1 and samples.t[0] == 0 and samples.duration == curve.duration
    (k,) = np.flatnonzero(samples.jumps)
    np.testing.assert_array_equal(samples.q[k], samples.q[k + 1])
    assert np.max(np.abs(samples.tau[k] - samples.tau[k + 1])) > 0.1  # it jumps: the bends are not the same
    first, second = curve.legs
    s = np.clip(samples.t[: k + 1] / first.duration, 0, 1)
    np.testing.assert_allclose(samples.tau[: k + 1], first.torques(nlp_data.robot, s), atol=1e-9)  # of s from t: an ulp
    s = (samples.t[k + 1 :] - first.duration) / second.duration
    np.testing.assert_allclose(samples.q[k + 1 :], second.at(s)[0], atol=1e-12)
    for leg, t, count in ((first, samples.t[: k + 1], 3), (second, samples.t[k + 1 :] - first.duration, 10)):
        assert t.size == count * leg.basis.intervals + 1


def test_where_the_torque_may_not_jump_legs_share_a_sample():
    nlp_data = problem("via")
    curve = bent(nlp_data)
    jumping, smooth = (curve.trajectory(nlp_data.robot, [3, 10], jumps=jumps) for jumps in (True, False))
    assert smooth.t.size == jumping.t.size - 1 and not np.any(smooth.jumps)
    assert curve.passing[0] in smooth.t


def test_legs_are_values():
    leg = CurveLeg(Basis(graded(2, 1.0)), np.zeros((6, 2)), 1.0)
    with pytest.raises(AttributeError):
        leg.duration = 2.0


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
