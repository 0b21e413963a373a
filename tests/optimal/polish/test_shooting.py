"""Segments of bang arcs: their ends against another integrator, their derivatives against differences."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from armdyn.dynamics.numeric import forward_dynamics
from armdyn.optimal.polish.shooting import BangShooting
from armdyn.optimal.polish.structure import Switches
from armdyn.optimal.problem.policy.policy import Policy
from problems import paper_problem


@pytest.fixture
def segments():
    """Two arcs of an RR arm, in segments that do not meet, with costates drawn at random."""
    problem, random = paper_problem("rr"), np.random.default_rng(3)
    switches = Switches.ordered(np.array([1.0, -1.0]), [np.array([0.08]), np.empty(0)], 0.2)
    shooting = BangShooting.of(problem, Policy.of(problem), switches, np.array([1.7, 0.9, 14.0, 9.0]))
    x = random.uniform(-1, 1, (shooting.arc_of.size, 4))
    return shooting, switches.lengths / shooting.unit, x, random.uniform(-1, 1, x.shape)


def test_ends_agree_with_another_integrator(segments):
    shooting, lengths, x, _ = segments
    ends, h, a = shooting.ends(lengths, x), shooting.seconds(lengths), forward_dynamics(shooting.problem.robot)
    for k in (0, h.size - 1):

        def rate(t, y, tau=shooting.tau[k]):
            return np.concatenate([y[2:], a(y[:2], y[2:], tau)])

        found = solve_ivp(rate, (0, h[k]), x[k] * shooting.size, method="DOP853", rtol=1e-12, atol=1e-12)
        # Steps of order six of 1.5 ms at up to 14 rad/s.
        np.testing.assert_allclose(ends.x[k] * shooting.size, found.y[:, -1], atol=1e-8)


def test_first_derivatives_agree_with_differences(segments):
    shooting, lengths, x, _ = segments
    ends, step = shooting.ends(lengths, x), 1e-5
    for i in range(4):
        moved = step * np.eye(4)[i]
        there, back = shooting.ends(lengths, x + moved).x, shooting.ends(lengths, x - moved).x
        # Differences err by the square of the step, and by rounding over it.
        np.testing.assert_allclose(ends.by_start[:, :, i], (there - back) / (2 * step), rtol=1e-5, atol=1e-6)
    there, back = shooting.ends(lengths * (1 + step), x).x, shooting.ends(lengths * (1 - step), x).x
    by_length = (there - back) / (2 * step * (lengths[shooting.arc_of] * shooting.share)[:, None])
    np.testing.assert_allclose(ends.rate, by_length, rtol=1e-5, atol=1e-5)


def test_second_derivatives_agree_with_differences(segments):
    shooting, lengths, x, costate = segments
    ends = shooting.ends(lengths, x)
    hessian, step = shooting.hessian(lengths, ends, costate), 1e-4

    def gradient(lengths, x):
        there = shooting.ends(lengths, x)
        by_x = np.einsum("sab,sa->sb", there.by_start, costate)
        return np.column_stack([by_x, np.sum(there.rate * costate, axis=1)])

    for i in range(4):
        moved = step * np.eye(4)[i]
        column = (gradient(lengths, x + moved) - gradient(lengths, x - moved)) / (2 * step)
        # Simpson's rule over eighths of a segment; the numbers are of the order of 1.
        np.testing.assert_allclose(hessian[:, i], column, atol=1e-3)
    along = gradient(lengths * (1 + step), x) - gradient(lengths * (1 - step), x)
    column = along / (2 * step * (lengths[shooting.arc_of] * shooting.share)[:, None])
    np.testing.assert_allclose(hessian[:, 4], column, atol=1e-3)
