"""Segments of bang arcs: their ends against another integrator, their derivatives against differences."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from armdyn.dynamics.numeric import forward_dynamics
from armdyn.optimal.polish.bang_motion import BangMotion
from armdyn.optimal.polish.polish import Switches
from armdyn.optimal.problem.task import Task
from problems import paper_problem


@pytest.fixture
def segments():
    """Two arcs of an RR arm, in segments that do not meet, with costates drawn at random."""
    problem, random = paper_problem("rr"), np.random.default_rng(3)
    switches = Switches.ordered(np.array([1.0, -1.0]), [np.array([0.08]), np.empty(0)], 0.2)
    rest = np.array([0.0, 1.0]), np.zeros((2, 4))
    size = np.array([1.7, 0.9, 14.0, 9.0])
    motion = BangMotion.of(Task.of(problem), switches.signs, switches.lengths, rest, size)
    x = random.uniform(-1, 1, (motion.arc_of.size, 4))
    return replace(motion.integrated(motion.lengths, x), costate=random.uniform(-1, 1, x.shape))


def test_ends_agree_with_another_integrator(segments):
    h, a = segments.seconds, forward_dynamics(segments.task.problem.robot)
    for k in (0, h.size - 1):

        def rate(t, y, tau=segments.tau[k]):
            return np.concatenate([y[2:], a(y[:2], y[2:], tau)])

        found = solve_ivp(rate, (0, h[k]), segments.x[k] * segments.size, method="DOP853", rtol=1e-12, atol=1e-12)
        # Steps of order six of 1.5 ms at up to 14 rad/s.
        np.testing.assert_allclose(segments.states[-1, k] * segments.size, found.y[:, -1], atol=1e-8)


def difference(segments, value, step, i=None):
    """Central difference of a value by a state, or by the lengths of all segments."""
    if i is None:
        there, back = (value(segments.integrated(segments.lengths * (1 + sign * step), segments.x)) for sign in (1, -1))
        return (there - back) / (2 * step * (segments.lengths[segments.arc_of] * segments.share)[:, None])
    there, back = (
        value(segments.integrated(segments.lengths, segments.x + sign * step * np.eye(4)[i])) for sign in (1, -1)
    )
    return (there - back) / (2 * step)


def test_first_derivatives_agree_with_differences(segments):
    by_start, rate = segments.flow[-1], segments.rate
    for i in range(4):
        # Differences err by the square of the step, and by rounding over it.
        found = difference(segments, lambda one: one.states[-1], 1e-5, i)
        np.testing.assert_allclose(by_start[:, :, i], found, rtol=1e-5, atol=1e-6)
    found = difference(segments, lambda one: one.states[-1], 1e-5)
    np.testing.assert_allclose(rate, found, rtol=1e-5, atol=1e-5)


def test_second_derivatives_agree_with_differences(segments):
    def gradient(motion):
        by_x = np.einsum("sab,sa->sb", motion.flow[-1], motion.costate)
        return np.column_stack([by_x, np.sum(motion.rate * motion.costate, axis=1)])

    for i in range(4):
        # Simpson's rule over eighths of a segment; the numbers are of the order of 1.
        found = difference(segments, gradient, 1e-4, i)
        np.testing.assert_allclose(segments.curvature[:, i], found, atol=1e-3)
    np.testing.assert_allclose(segments.curvature[:, 4], difference(segments, gradient, 1e-4), atol=1e-3)
