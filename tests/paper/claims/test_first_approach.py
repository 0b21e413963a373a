"""The linearised link: closed form against matrix exponential, integrator and optimiser."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import linprog

from armdyn.errors import ProblemError
from armdyn.paper.claims.first_approach import THETA_START, OneLink, linearisation, printed_law
from paper.references import EVERY, reference

GOAL = np.pi / 20
LINKS = st.builds(OneLink, st.floats(1e-3, 1e-1), st.floats(0.1, 5.0), st.floats(0.1, 5.0))


def matrix(link):
    return np.array([[0, 1], [link.r, 0]])


@given(LINKS, st.floats(0, 2))
def test_transition_is_the_matrix_exponential(link, t):
    found = link.transition(t)
    # expm loses about |tM| ulps, ω² t up to 1e4 here.
    np.testing.assert_allclose(found, expm(t * matrix(link)), rtol=1e-9, atol=1e-9 * np.max(np.abs(found)))
    assert np.linalg.det(found) == pytest.approx(1, abs=1e-12)


def test_flow_agrees_with_an_integrator_with_the_affine_term():
    link = OneLink.of(0.1006)

    def rate(t, x):  # equation (13) with the affine term as a vector
        return matrix(link) @ x + [0, link.k * 2.0] + np.array([0, link.r * np.pi / 2])

    run = solve_ivp(rate, (0, 0.3), [-1.0, 2.0], "DOP853", rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(link.flow([-1.0, 2.0], 2.0, 0.3), run.y[:, -1], atol=1e-9)  # the integrator's drift


@given(LINKS, st.floats(0.01, 40))
def test_the_law_ends_at_rest_at_the_goal_and_switches_every_half_turn(link, reach):
    goal = THETA_START + reach * link.torque_limit / link.gravity
    law = link.linearised_minimum_time(goal)
    x = np.array([THETA_START, 0.0])
    edges = [0.0, *law.switches, law.duration]
    for start, end, sign in zip(edges[:-1], edges[1:], law.signs, strict=True):
        x = link.flow(x, sign * link.torque_limit, end - start)
    amplitude = link.torque_limit / link.gravity
    # Rounding in arccos near 0 and π: half the digits of one ulp of the reach.
    np.testing.assert_allclose((x - [goal, 0]) / [1, link.omega], 0, atol=1e-6 * amplitude * max(reach, 1))
    turns = np.diff(edges) * link.omega
    np.testing.assert_allclose(turns[1:-1], np.pi, rtol=1e-9)
    assert np.all(turns <= np.pi + 1e-9) and law.signs[-1] == -1
    assert np.all(np.diff(law.signs) != 0)


def test_no_torque_within_the_limit_is_faster():
    """The linear problem on a grid is a linear programme: the farthest point reached at rest by time T."""
    link = OneLink.of(0.1006)
    law = link.linearised_minimum_time(GOAL)

    def reach(duration, steps=2000):
        h = duration / steps
        to_end = [link.transition((steps - k - 1) * h) for k in range(steps)]
        pushed = link.flow([THETA_START, 0.0], 1.0, h) - [THETA_START, 0.0]
        push = np.array([e @ pushed for e in to_end])
        best = linprog(
            -push[:, 0], A_eq=push[:, 1:].T, b_eq=[0], bounds=[(-link.torque_limit, link.torque_limit)] * steps
        )
        return THETA_START - best.fun

    # 2000 steps miss the switch by half a step at most, which costs second order of 1/2000.
    assert reach(law.duration) == pytest.approx(GOAL, abs=1e-5)
    assert reach(0.999 * law.duration) < GOAL - 1e-4


@pytest.mark.parametrize(("payload", "reading"), EVERY)
def test_minimum_time_of_the_true_link_is_exact(payload, reading):
    one = linearisation(payload, reading)
    # Both are quadratures to about 1e-13.
    assert one.exact.duration == pytest.approx(reference("minimum_time_r", reading, payload), abs=1e-11)


def test_linearisation_is_faster_than_the_truth_and_misses_the_goal():
    one = linearisation(0.1006)
    assert -0.03 < one.linearised.duration / one.exact.duration - 1 < -0.01
    # Its gravity at the goal is 1.73 of the true one: its brake comes late, and the link arrives with speed.
    assert one.miss[0] > 0.01 and one.miss[1] > 1.0


def test_trajectory_is_the_law_drawn():
    link = OneLink.of(0.2)
    law = link.linearised_minimum_time(GOAL)
    motion = link.trajectory(law)
    assert motion.duration == pytest.approx(law.duration, rel=1e-12)
    np.testing.assert_allclose([motion.q[-1, 0], motion.v[-1, 0]], [GOAL, 0], atol=1e-9)
    assert set(motion.tau.ravel()) == {3.0, -3.0}


def test_printed_matrix_is_no_exponential():
    link = OneLink.of(0.1006)
    law = printed_law(link)
    t = 0.05
    np.testing.assert_array_equal(law.transition(0), np.eye(2))
    assert not np.allclose(law.transition(t), expm(t * matrix(link)), atol=0.1)
    # A linear system with tr M = 0 keeps areas: its determinant is 1 at all times.
    assert abs(law.determinant(t) - 1) > 1
    assert law.determinant(t) == pytest.approx(np.cos(link.r * t) ** 2 - link.r * np.sin(link.r * t) ** 2)
    assert law.determinant(law.interval) == pytest.approx(1)
    assert law.amplitude(law.interval) == pytest.approx(link.k)


def test_goals_that_are_not_above_are_refused():
    link = OneLink.of(0.1006)
    with pytest.raises(ProblemError, match="moves up"):
        link.linearised_minimum_time(-2.0)
    with pytest.raises(ProblemError, match="do not push"):
        OneLink(0.1, 5.0, 3.0).minimum_time(-np.pi / 2, GOAL)
