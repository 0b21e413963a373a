"""Cart-pole, acrobot, pendubot and Furuta pendulum from end to end: joints without a motor are swung by the others."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.verify.arc import Mode
from armdyn.paper import solve_indirect
from problems import miss, solve
from underactuated import BY_HAND, bang_bang_duration, linear_side_move

UP = np.pi


def problem_of(name, goal, **more):
    return ad.MinimumTimeProblem(ad.Robot.from_library(name), q_start=[0, 0], q_goal=goal, **more)


def motor_of(problem):
    return int(np.flatnonzero(~problem.limits.passive)[0])


def torques_of(solution):
    """Of the motor on every arc [N m or N]."""
    i = motor_of(solution.problem)
    side = {Mode.UPPER: solution.problem.limits.effort_upper[i], Mode.LOWER: solution.problem.limits.effort_lower[i]}
    return [side[arc.modes[i]] for arc in solution.arcs]


def assert_optimal(solution):
    """Certified, and replayed from nothing but its torques."""
    problem = solution.problem
    assert solution.certified, solution.message
    passive = problem.limits.passive
    assert not np.any(solution.trajectory.tau[:, passive])
    assert all(arc.modes[i] is Mode.PASSIVE for arc in solution.arcs for i in np.flatnonzero(passive))
    replay = ad.replay_torques(problem.robot, solution.trajectory)
    assert miss(problem, replay) < 1e-6  # a motion claimed optimal ends as near


BANG_BANG = [
    pytest.param("cart_pole", [1.0, 0.0], 3.0, 1.559332194, id="side move"),
    pytest.param("cart_pole", [0.0, UP], 10.0, 1.446505671, id="cart-pole", marks=pytest.mark.slow),
    pytest.param("pendubot", [UP, 0.0], 1.5, 1.462102392, id="pendubot", marks=pytest.mark.slow),
    pytest.param("acrobot", [UP, 0.0], 8.0, 2.539345258, id="acrobot", marks=pytest.mark.slow),
]
"""Robot, goal, torque limit [N or N m], duration [s], from searches of 120 to 250 guesses."""


@pytest.mark.slow
@pytest.mark.parametrize(("name", "goal", "limit", "duration"), BANG_BANG)
def test_bang_bang_motions(name, goal, limit, duration):
    solution = solve(problem_of(name, goal, effort_limit=limit))
    assert_optimal(solution)
    assert solution.duration == pytest.approx(duration, rel=1e-8)  # ten digits of a best known
    # The same four arcs from equations derived by hand, another integrator and MINPACK, from neighbouring durations.
    torques, durations = torques_of(solution), np.array([arc.duration for arc in solution.arcs])
    beside = durations * (1 + 1e-3 * np.array([1, -1, 1, -1]))
    by_hand = bang_bang_duration(BY_HAND[name], beside, torques, [0, 0], goal)
    assert solution.duration == pytest.approx(by_hand, rel=1e-9)  # the integrators' 1e-11, some ten times over
    assert solution.decides[0].joint == solution.problem.robot.joint_names[motor_of(solution.problem)]


@pytest.mark.slow
def test_the_indirect_method_agrees():
    problem = problem_of("cart_pole", [1.0, 0.0], effort_limit=3.0)
    found = solve_indirect(problem)
    assert found.success, found.message
    assert found.duration == pytest.approx(1.559332194022, rel=1e-10)  # shooting is as good as its integrator
    assert {arc.modes[1] for arc in found.arcs} == {Mode.PASSIVE}
    smooth = problem_of("cart_pole", [1.0, 0.0], effort_weight=0.05)
    direct, indirect = solve(smooth), solve_indirect(smooth)
    assert_optimal(direct)
    assert indirect.duration == pytest.approx(direct.duration, rel=1e-6)  # Lobatto's tolerance


def test_small_side_moves_follow_linear_theory():
    """A tenth of a metre for every newton is one linear motion; nonlinear terms fall with its square."""
    beside = []
    for force in (0.8, 0.4, 0.2):
        solution = solve(problem_of("cart_pole", [0.3 * force, 0.0], effort_limit=force))
        assert_optimal(solution)
        assert len(solution.arcs) == 4
        beside.append(solution.duration / linear_side_move(0.3 * force, force) - 1)
    assert abs(beside[-1]) < 1e-3
    # 4 but for terms of the fourth order, which the angles, a tenth of a radian, leave at 1 %.
    np.testing.assert_allclose(np.divide(beside[:-1], beside[1:]), 4, rtol=0.05)


SINGULAR = [
    pytest.param("cart_pole", [1.0, 0.0], 1.1359928, id="cart-pole, aside"),
    pytest.param("cart_pole", [0.0, UP], 1.0452574, id="cart-pole, up"),
    pytest.param("furuta_pendulum", [1.0, 0.0], 0.4275337, id="Furuta pendulum, aside"),
    pytest.param("furuta_pendulum", [0.0, UP], 0.4635122, id="Furuta pendulum, up"),
    pytest.param("pendubot", [UP, 0.0], 0.7052652, id="pendubot, up"),
    pytest.param("pendubot", [0.0, UP], 0.8689684, id="pendubot, elbow up"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "goal", "duration"), SINGULAR)
def test_strong_motors_have_singular_arcs(name, goal, duration):
    solution = solve(problem_of(name, goal))
    assert_optimal(solution)
    assert any(arc.singular for arc in solution.arcs)
    # The resolved mesh follows torques between the limits to 1e-6.
    assert solution.duration == pytest.approx(duration, rel=1e-6)
    i = motor_of(solution.problem)
    level = np.abs(solution.trajectory.tau[:, i]) / solution.problem.limits.effort_upper[i]
    between = np.diff(solution.trajectory.t) @ (level[:-1] < 0.98)
    assert between > 0.05 * solution.duration


def test_a_start_that_is_no_equilibrium():
    robot = ad.Robot.from_library("cart_pole", effort_limit=5.0)
    solution = solve(ad.MinimumTimeProblem(robot, q_start=[0.0, 0.6], q_goal=[0.0, 0.0], v_start=[0.0, -1.0]))
    assert_optimal(solution)


def test_velocity_limits_with_a_joint_without_a_motor():
    solution = solve(problem_of("cart_pole", [1.0, 0.0], effort_limit=10.0, velocity_limit=[0.8, np.inf]))
    assert_optimal(solution)
    assert Mode.VELOCITY_UPPER in {arc.modes[0] for arc in solution.arcs}
    assert solution.lower_bound < solution.duration  # a bound is proven where velocities are limited


@pytest.mark.slow
def test_either_way_up():
    """From hanging down the two ways are mirror images."""
    one, other = (solve(problem_of("cart_pole", [0.0, up], effort_limit=10.0)) for up in (UP, -UP))
    assert one.duration == pytest.approx(other.duration, rel=1e-9)
    either = solve(problem_of("cart_pole", [0.0, 3 * UP], effort_limit=10.0, wrap=True))
    assert either.duration == pytest.approx(one.duration, rel=1e-9)


@pytest.mark.slow
def test_path_constraints():
    limit = ad.TorqueRateLimit(200.0)
    solution = solve(problem_of("cart_pole", [1.0, 0.0], effort_limit=10.0, path_constraints=[limit]))
    assert solution.usable and solution.duration > 1.2313  # without: bang-bang
    assert not np.any(solution.trajectory.tau[:, 1])
