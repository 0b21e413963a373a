"""A trajectory between its samples: cubic Hermite positions, their exact derivatives, linear torques."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BPoly

import armdyn as ad
from armdyn.trajectory.interpolation import PARTS, between_rows, interpolated

NUMBER = st.floats(-5, 5)


@st.composite
def trajectories(draw):
    n, joints = draw(st.integers(2, 6)), draw(st.integers(1, 3))
    steps = draw(st.lists(st.floats(0.05, 3.0), min_size=n - 1, max_size=n - 1))
    start = draw(st.floats(-3, 3))

    def table():
        return np.array(draw(st.lists(NUMBER, min_size=n * joints, max_size=n * joints))).reshape(n, joints)

    return ad.Trajectory(start + np.concatenate([[0], np.cumsum(steps)]), table(), table(), table())


@given(trajectories())
def test_samples_are_met(motion):
    at = motion(motion.t)
    # Velocities go through a division by a step of at least 0.05 s.
    np.testing.assert_allclose(at.q, motion.q, atol=1e-12)
    np.testing.assert_allclose(at.v, motion.v, atol=1e-10)
    np.testing.assert_allclose(at.tau, motion.tau, atol=1e-12)


@given(trajectories(), st.floats(0, 1))
def test_velocity_is_the_derivative_of_position(motion, part):
    k = int(part * (motion.t.size - 1.001))
    step = motion.t[k + 1] - motion.t[k]
    middle, h = motion.t[k] + step * (0.1 + 0.8 * part), 1e-4 * step
    # The slope of a cubic by central differences errs by h² of its third derivative, and rounding over h.
    slope = (motion(middle + h).q - motion(middle - h).q) / (2 * h)
    np.testing.assert_allclose(motion(middle).v, slope, atol=1e-5 / step)


@given(st.lists(NUMBER, min_size=4, max_size=4), st.lists(st.floats(0.05, 2), min_size=1, max_size=5), st.floats(0, 1))
def test_cubics_are_exact_on_any_samples(coefficients, steps, part):
    cubic = np.polynomial.Polynomial(coefficients)
    t = np.concatenate([[0], np.cumsum(steps)])
    motion = ad.Trajectory(t, cubic(t)[:, None], cubic.deriv()(t)[:, None], np.zeros((t.size, 1)))
    at, scale = part * t[-1], 1 + np.max(np.abs(cubic(t)))
    np.testing.assert_allclose(motion(at).q, cubic(at), atol=1e-12 * scale)
    np.testing.assert_allclose(motion(at).v, cubic.deriv()(at), atol=1e-10 * scale / min(steps))


@given(trajectories(), st.lists(st.floats(0, 1), min_size=1, max_size=5))
def test_torque_is_linear_and_stays_between_its_samples(motion, parts):
    t = motion.t[0] + motion.duration * np.array(parts)
    expected = np.stack([np.interp(t, motion.t, column) for column in motion.tau.T], axis=1)
    np.testing.assert_allclose(motion(t).tau, expected, atol=1e-11)
    assert np.all(motion(t).tau <= motion.tau.max(axis=0) + 1e-12)


@given(trajectories(), st.floats(0.001, 100))
def test_outside_its_ends_are_held(motion, away):
    for time, end in ((motion.t[0] - away, motion.t[0]), (motion.t[-1] + away, motion.t[-1])):
        for one, other in zip(motion(time), motion(end), strict=True):
            np.testing.assert_array_equal(one, other)


@given(trajectories(), st.floats(0, 1), st.floats(-10, 10))
def test_the_clock_may_start_anywhere(motion, part, later):
    moved = ad.Trajectory(motion.t + later, motion.q, motion.v, motion.tau)
    at = motion.t[0] + part * motion.duration
    # Times are rounded to 1e-14 s; nothing here is faster than some 500 /s.
    np.testing.assert_allclose(moved(at + later).q, motion(at).q, atol=1e-10)


@pytest.mark.parametrize("shape", [(), (3,), (2, 3), (0,)])
def test_the_answer_has_the_shape_of_the_question(shape):
    motion = ad.Trajectory([0, 1], np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)))
    assert all(part.shape == (*shape, 2) for part in motion(np.zeros(shape)))


def test_a_jump_is_seen_on_both_sides():
    t = [0.0, np.nextafter(1.0, 0), 1.0, 2.0]
    motion = ad.Trajectory(t, np.zeros((4, 1)), np.zeros((4, 1)), [[1.0], [1.0], [-1.0], [-1.0]])
    assert motion([0.5, t[1], 1.0, 1.5]).tau.ravel().tolist() == [1.0, 1.0, -1.0, -1.0]


@pytest.mark.parametrize("m", [1, 2, 3])
def test_splines_through_derivatives_are_those_of_scipy(m):
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.05, 1.0, 7))
    rows = [rng.uniform(-5, 5, (7, 2)) for _ in range(m)]
    spline = BPoly.from_derivatives(t, np.stack(rows, axis=1))
    # Few times, in some of the intervals, and the many between rows: neither at a row, where the last ones may jump.
    few = rng.uniform(t[2], t[4], 5)
    for found, order in zip(interpolated(t, rows, few), range(3), strict=True):
        # Rounding of at most 60 times a value, over a step of 0.05 s for each derivative.
        np.testing.assert_allclose(found, spline(few, order), atol=1e-12 / 0.05**order)
    at, q, v = between_rows(t, rows)
    inside = ~np.isin(at, t)
    assert inside.sum() == 6 * (PARTS - 1) and np.isin(t, at).all()
    np.testing.assert_allclose(q, spline(at), atol=1e-12)
    np.testing.assert_allclose(v[inside], spline(at[inside], 1), atol=1e-12 / 0.05)
