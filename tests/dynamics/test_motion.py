"""Explicit and implicit steps against scipy's integrators and difference quotients; tableaus of collocation."""

import numpy as np
import pytest
from scipy.integrate import DOP853, solve_ivp
from scipy.special import roots_legendre

import armdyn as ad
from armdyn.dynamics import motion
from armdyn.dynamics.motion import GAUSS_3, LOBATTO_3, STAGES, Collocation, Feedback, replayed, tracked
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.models.values.actuator_limits import ConstantTorque
from oracles import robot_named

LOOSE = 1e3
"""A relative tolerance that every step keeps."""


def swing(duration, samples=2, name="rr"):
    """An arm that falls under torques that change linearly."""
    robot = robot_named(name)
    t, n = np.linspace(0, duration, samples), robot.nv
    tau = (1 - 30 * t)[:, None] * np.ones(n)
    return robot, ad.Trajectory(t, np.full((samples, n), 0.4), np.full((samples, n), -1.0), tau)


def rate_of(robot, motion):
    acceleration, n = forward_dynamics(robot), robot.nv
    slope = (motion.tau[-1] - motion.tau[0]) / motion.duration
    return lambda t, x: np.concatenate([x[n:], acceleration(x[:n], x[n:], motion.tau[0] + t * slope)])


def exact(robot, motion, rtol=1e-13):
    x = np.concatenate([motion.q[0], motion.v[0]])
    return solve_ivp(rate_of(robot, motion), (0, motion.duration), x, "DOP853", rtol=rtol, atol=1e-15).y[:, -1]


def test_a_step_is_scipys():
    robot, wanted = swing(0.05)
    x = np.concatenate([wanted.q[0], wanted.v[0]])
    solver = DOP853(rate_of(robot, wanted), 0, x, 0.05, rtol=LOOSE, atol=1e-2 * LOOSE, first_step=0.05)
    solver.step()
    assert solver.t == 0.05
    # The same sums in another order.
    np.testing.assert_allclose(replayed(robot, wanted, LOOSE, 0)[1], solver.y, rtol=1e-14, atol=1e-14)


def test_order_is_eight():
    errors = []
    for h in (0.01, 0.005):
        robot, wanted = swing(h)
        errors.append(np.max(np.abs(replayed(robot, wanted, LOOSE, 0)[1] - exact(robot, wanted))))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(9, abs=0.2)  # of one step


def test_halves_are_made_until_the_tolerance_is_kept():
    robot, wanted = swing(0.2, name="ur5")
    found = replayed(robot, wanted, 1e-11, 10_000)
    np.testing.assert_allclose(found[1], exact(robot, wanted), atol=1e-9)  # some ten errors of 1e-11, grown by the fall
    assert len(replayed(robot, wanted, 1e-11, 2 * STAGES)) == 1  # there are more halves than that
    assert len(replayed(robot, wanted, LOOSE, 0)) == 2


def test_no_time_passes_over_a_jump():
    robot, wanted = swing(0.02, samples=5)
    t, tau = wanted.t.copy(), wanted.tau.copy()
    t[2], tau[2:] = np.nextafter(t[1], 1), 7.0
    found = replayed(robot, ad.Trajectory(t, wanted.q, wanted.v, tau), 1e-10, 1000)
    np.testing.assert_array_equal(found[2], found[1])
    later = ad.Trajectory(t[2:] - t[2], *np.split(found[2:], 2, axis=1), tau[2:])
    np.testing.assert_allclose(replayed(robot, later, 1e-10, 1000), found[2:], rtol=1e-15)


def test_numbers_that_are_not_finite_end_it():
    robot, wanted = swing(0.02, samples=5)
    limits = ConstantTorque(np.full(2, -9.0), np.full(2, 9.0))
    tau = wanted.tau.copy()
    tau[3] = np.nan
    x, feedback = np.concatenate([wanted.q[0], wanted.v[0]]), Feedback(0.0, np.ones(4), 0)
    states, torques = tracked(robot, wanted, tau, x, feedback, limits, rtol=1e-10, spare=1000)
    np.testing.assert_array_equal(states, replayed(robot, wanted, 1e-10, 1000)[:3])
    np.testing.assert_array_equal(torques, tau)


def test_feedback_leads_back_to_the_motion():
    robot, wanted = swing(0.5, 200, "ur5")
    states = replayed(robot, wanted, 1e-10, 1000)
    wanted = ad.Trajectory(wanted.t, *np.split(states, 2, axis=1), wanted.tau)
    x, limits = states[0] + 0.01, ConstantTorque(np.full(6, -1e4), np.full(6, 1e4))
    ends = [
        tracked(robot, wanted, wanted.tau, x, Feedback(40.0, np.full(199, fade), 0), limits, rtol=1e-10, spare=1000)
        for fade in (0.0, 1.0)
    ]
    assert np.max(np.abs(ends[0][0][-1] - states[-1])) > 1e-3
    assert np.max(np.abs(ends[1][0][-1] - states[-1])) < 1e-5  # exp(-20) (1 + 20) of 0.01, and its velocities 40 times
    # Torques act as they are given back: from the same start they lead to the same end.
    again = ad.Trajectory(wanted.t, *np.split(np.vstack([x, states[1:]]), 2, axis=1), ends[1][1])
    np.testing.assert_allclose(replayed(robot, again, 1e-10, 1000), ends[1][0], atol=1e-12)


def implicit(robot):
    return Collocation(robot, GAUSS_3, 1e-14, 1e-9, 12)


@pytest.mark.parametrize("name", ["rr", "kinova"])
def test_implicit_steps_are_of_order_six(name):
    robot, wanted = swing(4e-3, name=name)
    x, tau = np.concatenate([wanted.q[0], wanted.v[0]])[None], wanted.tau[None]
    ends = [implicit(robot)(np.array([4e-3]), x, tau, parts)[0][0] for parts in (1, 2)]
    first, second = (np.max(np.abs(end - exact(robot, wanted))) for end in ends)
    assert first / second == pytest.approx(2**6, rel=0.1)  # two steps of half the length err by 2⁻⁶


@pytest.mark.parametrize("name", ["rr", "kinova"])
def test_implicit_steps_know_their_derivatives(name):
    """Those of the step itself, not of the arm's motion alone: equal to central differences of the step's end."""
    h, step = (
        4e-3,
        1e-4,
    )  # differences: the end's rounding of 1e-14 over the step, and its square times third derivatives
    robot, wanted = swing(h, name=name)
    x, tau = np.concatenate([wanted.q[0], wanted.v[0]]), wanted.tau

    def end(x, tau):
        return implicit(robot)(np.array([h]), x[None], tau[None])[0][0]

    by_x = np.column_stack([(end(x + own, tau) - end(x - own, tau)) / (2 * step) for own in step * np.eye(x.size)])
    by_tau = np.column_stack([(end(x, tau + own) - end(x, tau - own)) / (2 * step) for own in step * np.eye(robot.nv)])
    _, (transition,), (forced,) = implicit(robot)(np.array([h]), x[None], tau[None])
    np.testing.assert_allclose(transition, by_x, atol=1e-8 * np.abs(by_x).max())
    np.testing.assert_allclose(forced, by_tau, atol=1e-8 * np.abs(by_tau).max())


def test_arrays_that_do_not_fit_are_refused():
    robot, wanted = swing(0.02)
    with pytest.raises(ValueError, match="do not match"):
        implicit(robot)(np.array([0.02]), np.zeros((1, 3)), wanted.tau[None])
    with pytest.raises(ValueError, match="do not match"):
        forward_dynamics(robot)(np.zeros(3), np.zeros(3), np.zeros(3))
    with pytest.raises(ValueError, match="do not match"):
        motion.bridge_arm(robot).replay(
            motion._explicit(), wanted.t, wanted.tau, wanted.tau, wanted.jumps, np.zeros(4), 1e-10, 0
        )


def test_two_threads_make_the_steps_of_one(monkeypatch):
    robot, wanted = swing(0.5, 301)
    x, tau = np.concatenate([wanted.q, wanted.v], axis=1)[:-1], np.stack([wanted.tau[:-1], wanted.tau[1:]], axis=1)
    found = []
    for second in (False, True):
        monkeypatch.setattr(motion, "may_thread", lambda second=second: second)
        steps = Collocation(robot, GAUSS_3, 1e-14, 1e-9, 12)
        found.append(steps(np.diff(wanted.t), x, tau, 2))
    for one, both in zip(*found, strict=True):
        np.testing.assert_array_equal(one, both)


EVERY = pytest.mark.parametrize(("tableau", "order"), [(LOBATTO_3, 4), (GAUSS_3, 6)], ids=["lobatto", "gauss"])


@EVERY
def test_order_measured_on_a_nonlinear_equation(tableau, order):
    # x' = x cos t, x = exp(sin t): one Newton-free linear solve per interval, as f is linear in x.
    def error(n):
        h, x = 2.0 / n, 1.0
        for k in range(n):
            rate = np.cos(k * h + tableau.c * h)
            stages = np.linalg.solve(np.eye(tableau.c.size) - h * tableau.A * rate, np.full(tableau.c.size, x))
            x += h * tableau.b @ (rate * stages)
        return abs(x - np.exp(np.sin(2.0)))

    n = np.array([8, 16, 32])
    slope = np.polyfit(np.log(n), np.log([error(k) for k in n]), 1)[0]
    # A regression over two halvings is off the asymptotic order by a few per cent.
    assert -slope == pytest.approx(order, rel=0.05)


def test_nodes_are_scipys():
    # Half a unit in the last place of numbers below one.
    np.testing.assert_allclose(GAUSS_3.c, (1 + roots_legendre(3)[0]) / 2, rtol=0, atol=1e-16)


@EVERY
def test_polynomials_are_integrated_exactly(tableau, order):
    """Hairer, Wanner: Solving ODEs II, section IV.5: C(s), which makes it collocation, and B(order)."""
    c = tableau.c[:, None]
    assert np.all(np.diff(tableau.c) > 0)
    power = np.arange(1, c.size + 1)
    np.testing.assert_allclose(tableau.A @ c ** (power - 1), c**power / power, atol=1e-14)
    power = np.arange(1, order + 1)
    np.testing.assert_allclose(tableau.b @ c ** (power - 1), 1 / power, atol=1e-14)


def test_stages_that_are_knots():
    # Lobatto begins and ends at a knot: the program's equations rely on it.
    np.testing.assert_array_equal(LOBATTO_3.c, [0.0, 0.5, 1.0])
    assert not np.any(LOBATTO_3.A[0]) and np.array_equal(LOBATTO_3.A[-1], LOBATTO_3.b)
