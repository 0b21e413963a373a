"""Unknowns of a program and the motion that they stand for."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armdyn.optimal.mesh.layout import Layout, Parameters, bounds, to_trajectory, to_unknowns
from armdyn.optimal.mesh.starts import Guesses, spline
from armdyn.optimal.problem.options import Scheme
from armdyn.optimal.problem.task import Task
from armdyn.trajectory import Trajectory
from problems import paper_problem

SCHEMES = [Scheme(control) for control in ("linear", "constant")]
N = 6


@cache
def layout_of(scheme, intervals=N):
    return Layout(2, scheme)


def cubic(coefficients, t):
    """A motion that samples tell exactly: cubic positions, a constant torque."""
    polynomials = [np.polynomial.Polynomial(row) for row in coefficients]
    q = np.stack([p(t) for p in polynomials], axis=1)
    v = np.stack([p.deriv()(t) for p in polynomials], axis=1)
    return Trajectory(t, q, v, np.tile(coefficients[:, 0], (t.size, 1)))


def parameters(fractions, time, length, speed, effort):
    return Parameters(fractions, time, length, speed, np.zeros(2), effort, np.zeros(10))


FRACTIONS = st.lists(st.floats(0.2, 1), min_size=N, max_size=N).map(lambda x: np.array(x) / np.sum(x))
SCALES = st.tuples(*3 * [st.floats(0.2, 5)], st.tuples(*2 * [st.floats(0.2, 5)]).map(np.array))
COEFFICIENTS = st.lists(st.floats(-2, 2), min_size=8, max_size=8).map(lambda x: np.reshape(x, (2, 4)))


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
@settings(max_examples=20)
@given(fractions=FRACTIONS, scales=SCALES, coefficients=COEFFICIENTS, duration=st.floats(0.1, 3))
def test_there_and_back_is_the_same_motion(scheme, fractions, scales, coefficients, duration):
    """On any mesh, in any scales."""
    motion = cubic(coefficients, duration * np.array([0.0, 0.4, 1.0]))
    layout = layout_of(scheme)
    by = parameters(fractions, *scales)
    (x,) = to_unknowns(Guesses.of(motion), layout, by)
    assert x.size == layout.size(N)
    back = to_trajectory(x, layout, by, ("a", "b"))
    assert back.duration == pytest.approx(duration, rel=1e-13)
    at = np.linspace(0, duration, 25)
    # Scaling there and back, and a cubic through samples that are a twentieth of the duration apart.
    np.testing.assert_allclose(back(at).q, motion(at).q, atol=1e-10)
    np.testing.assert_allclose(back(at).v, motion(at).v, atol=1e-9 / duration)
    np.testing.assert_allclose(back(at).tau, motion(at).tau, atol=1e-12)


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_unknowns_and_back(scheme):
    random = np.random.default_rng(1)
    t = np.linspace(0, 1, 7)
    tau = np.repeat(random.normal(size=(1, 2)), 7, axis=0)  # constant, so that every control can say it
    motion = Trajectory(t, random.normal(size=(7, 2)), random.normal(size=(7, 2)), tau)
    by = parameters(np.full(6, 1 / 6), 1.0, 2.0, 3.0, np.array([3.0, 4.0]))
    layout = layout_of(scheme)
    back = to_trajectory(to_unknowns(Guesses.of(motion), layout, by)[0], layout, by, ())
    # Scaling there and back: an ulp or two.
    np.testing.assert_allclose(back(t).q, motion.q, atol=1e-14)
    np.testing.assert_allclose(back(t).v, motion.v, atol=1e-12)
    np.testing.assert_allclose(back(t).tau, motion.tau, atol=1e-14)


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_a_guess_is_within_the_bounds_and_its_ends_are_fixed(scheme):
    problem = paper_problem("rr", velocity_limit=[15.0, 20.0])
    guess, layout = Guesses.of(spline(problem, [])), layout_of(scheme)
    (scales,) = Parameters.sized(Task.of(problem), guess, np.full(N, 1 / N)).each()
    (lower,), (upper,) = bounds(problem, layout, scales)
    (x,) = to_unknowns(guess, layout, scales)
    # Start and goal are divided by a scale once and multiplied once.
    assert np.all(lower - 1e-12 <= x) and np.all(x <= upper + 1e-12)
    knots_lower, knots_upper = (side[layout.knots(N)] for side in (lower, upper))
    for k, (q, v) in ((0, (problem.q_start, problem.v_start)), (-1, (problem.q_goal, problem.v_goal))):
        state = np.concatenate([np.asarray(q) / scales.length, np.asarray(v) / scales.speed])
        np.testing.assert_allclose(knots_lower[k, :4], state, rtol=1e-14)
        np.testing.assert_allclose(knots_upper[k, :4], state, rtol=1e-14)
    speeds = knots_upper[1:-1, 2:4] * scales.speed
    np.testing.assert_allclose(speeds, np.tile([15.0, 20.0], (N - 1, 1)), rtol=1e-14)


def test_weights_of_torques():
    problem = paper_problem("rr", effort_limit=[2.0, 3.0], effort_weight=0.5)
    guess = Guesses.of(spline(problem, []))
    # w τ² of a torque at its scale; a tie costs every joint the same, half of each weight, one in all.
    np.testing.assert_allclose(Parameters.sized(Task.of(problem), guess, np.ones(1)).weights, [2.0, 4.5])
    tied = Parameters.sized(Task.of(problem.variant(effort_weight=0.0)), guess, np.ones(1), tie=0.1)
    assert tied.weights.sum() / 2 == pytest.approx(0.1)
