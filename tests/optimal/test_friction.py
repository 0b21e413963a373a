"""Minimum time with joint friction, against quadrature and against a simulation that is none of ours."""

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.special import expit, exprel

import armdyn as ad
from problems import cart, paper_problem, solve

DISTANCE, FORCE = 2.0, 1.0
"""Of the cart, whose mass is 1 kg."""


def viscous(damping):
    """v' = ±1 - d v from rest to rest: t_f = 2/d ln(1 + sqrt(1 - exp(-d² L))) + d L, for unit mass and force.

    Momentum gives t1 - t2 = d L; coming to rest exp(d t2) = 2 - exp(-d t1): a square equation.
    """
    return 2 / damping * np.log1p(np.sqrt(-np.expm1(-(damping**2) * DISTANCE))) + damping * DISTANCE


def dry(damping, coulomb, width):
    """The same with Coulomb friction, smooth as it is: dt = dv / (±1 - tau_f(v)), the peak velocity by root search.

    Near the terminal velocity (1 - c) / d, where 1 / (1 - tau_f) has a pole, v(u) = (1 - exp(-k u)) / k with
    k = d / (1 - c) takes it away: dv = exp(-k u) du, 1 - d v - c tanh(v / w) = (1 - c) exp(-k u) + c (1 - tanh(v / w)).
    """
    k = damping / (FORCE - coulomb)

    def phase(peak, sign):
        def time(u):
            v, slope = u * exprel(-k * u), np.exp(-k * u)
            speeding_up = (FORCE - coulomb) * slope + 2 * coulomb * expit(-2 * v / width)
            return v, slope / (speeding_up if sign > 0 else FORCE + damping * v + coulomb * np.tanh(v / width))

        points = [u for u in (width, 5 * width) if u < peak]
        options = {"points": points, "epsabs": 1e-12, "epsrel": 1e-12, "limit": 200}
        way = quad(lambda u: np.prod(time(u)), 0, peak, **options)[0]
        return way, quad(lambda u: time(u)[1], 0, peak, **options)[0]

    peak = brentq(lambda u: phase(u, 1)[0] + phase(u, -1)[0] - DISTANCE, 1e-3, 10.0, xtol=1e-14, rtol=1e-14)
    return phase(peak, 1)[1] + phase(peak, -1)[1]


def sharp(coulomb):
    """The limit of no width: constant accelerations 1 - F and 1 + F."""
    up, down = FORCE - coulomb, FORCE + coulomb
    return np.sqrt(2 * DISTANCE * up * down / (up + down)) * (1 / up + 1 / down)


def solved(robot):
    """Without machine code, which takes longer to build than all of these solves."""
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[DISTANCE])
    return ad.solve_minimum_time(problem, ad.MinimumTimeOptions(compile=False))


@pytest.mark.parametrize("damping", [0.05, 0.3, 2.0])
def test_viscous_damping_against_the_closed_form(damping):
    solution = solved(cart().with_friction(damping))
    assert solution.certificate.ok, solution.certificate.reasons
    # The promised accuracy; 1e-12 measured.
    assert solution.duration == pytest.approx(viscous(damping), rel=1e-8)


@pytest.mark.parametrize(
    ("damping", "coulomb", "width"), [(0.0, 0.3, 0.1), (0.0, 0.8, 0.01), (0.5, 0.3, 0.01), (0.0, 0.3, 1e-3)]
)
def test_coulomb_friction_against_quadrature(damping, coulomb, width):
    solution = solved(cart().with_friction(damping, coulomb, width))
    assert solution.certificate.ok, solution.certificate.reasons
    # The replay is aimed to 1e-9 m; the mesh of a narrow jump leaves 4e-7 at most, measured.
    assert solution.duration == pytest.approx(dry(damping, coulomb, width), rel=1e-8 if width == 0.1 else 1e-6)


def test_a_narrow_jump_tends_to_the_sharp_one():
    widths = np.array([1e-2, 1e-3, 1e-4])
    off = [solved(cart().with_friction(0.0, 0.3, width)).duration - sharp(0.3) for width in widths]
    # First order in the width, with one sign.
    assert np.polyfit(np.log(widths), np.log(np.negative(off)), 1)[0] == pytest.approx(1.0, abs=0.02)


def simulated(robot, trajectory, lost):
    """Where an implicit integrator with `pin.aba` and a friction of its own ends, (q, v)."""
    model, data = robot.model, robot.model.createData()
    x, t, n = np.concatenate([trajectory.q[0], trajectory.v[0]]), trajectory.t, robot.nv
    for k in np.flatnonzero(np.diff(t) > 1e-12):
        tau, slope = trajectory.tau[k], (trajectory.tau[k + 1] - trajectory.tau[k]) / (t[k + 1] - t[k])

        def rate(s, x, tau=tau, slope=slope, start=t[k]):
            u = tau + (s - start) * slope - lost(x[n:])
            return np.concatenate([x[n:], pin.aba(model, data, x[:n], x[n:], u)])

        x = solve_ivp(rate, (t[k], t[k + 1]), x, method="Radau", rtol=1e-9, atol=1e-11).y[:, -1]
    return x


@pytest.mark.slow
def test_rr_with_friction_is_certified_and_arrives():
    bare = paper_problem("rr")
    damping, coulomb, width = np.array([0.1, 0.1]), np.array([0.2, 0.2]), 0.05
    robot = bare.robot.with_friction(damping, coulomb, width)
    problem = ad.MinimumTimeProblem(robot, q_start=bare.q_start, q_goal=bare.q_goal)
    solution = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=8))
    assert solution.certificate.ok, solution.certificate.reasons
    assert solution.duration > 0.2107  # without friction
    end = simulated(robot, solution.trajectory, lambda v: damping * v + coulomb * np.tanh(v / width))
    # Radau's rtol of 1e-9 per step, over some hundred; without its friction the arm is a radian off.
    np.testing.assert_allclose(end, problem.x_goal, atol=1e-5)
    assert np.abs(simulated(robot, solution.trajectory, np.zeros_like) - problem.x_goal).max() > 0.1


@pytest.mark.slow
def test_ur5_with_damping_and_coulomb_friction_arrives():
    damping, coulomb = np.array([10, 10, 10, 2, 2, 2.0]), np.array([8, 8, 8, 2, 2, 2.0])
    robot = ad.Robot.from_library("ur5", damping=damping, friction=coulomb)
    problem = ad.MinimumTimeProblem(
        robot, q_start=[0, -1.2, 1.2, -1.0, 0.5, 0.0], q_goal=[1.0, -0.6, 0.4, -1.8, -0.8, 1.2]
    )
    solution = solve(problem)
    width = robot.friction.width
    end = simulated(robot, solution.trajectory, lambda v: damping * v + coulomb * np.tanh(v / width))
    # The replay lands to 1e-9 rad by another integrator; both hold 1e-9 per step over some hundred steps.
    np.testing.assert_allclose(end[:6], problem.q_goal, atol=1e-6)
    np.testing.assert_allclose(end[6:], 0.0, atol=1e-4)
    assert solution.duration > problem.duration_bound()


def test_torques_of_a_path_pay_for_friction():
    robot = cart().with_friction(0.5, 0.2, 0.1)
    t = np.linspace(0, 1, 11)
    path = ad.trajectory_from_path(robot, t, t[:, None], np.ones((11, 1)), np.zeros((11, 1)))
    np.testing.assert_allclose(path.tau[:, 0], 0.5 + 0.2 * np.tanh(10.0), rtol=1e-12)


@pytest.mark.slow
def test_three_links_land_through_dry_friction():
    """Friction bends a motion within the steps of a mesh: slowed down until it lands, it takes 0.48 s."""
    bare = paper_problem("rrr")
    robot = bare.robot.with_friction(0.3, 0.3)
    ends = {"q_start": bare.q_start, "q_goal": bare.q_goal, "velocity_limit": 15.0}  # they reach 11 rad/s
    solution = ad.solve_minimum_time(ad.MinimumTimeProblem(robot, **ends), ad.MinimumTimeOptions(starts=8, bound=False))
    assert solution.usable and solution.duration < 0.43
    replay = ad.replay_torques(robot, solution.trajectory)
    assert np.max(np.abs(replay.q[-1] - bare.q_goal)) < 1e-6
