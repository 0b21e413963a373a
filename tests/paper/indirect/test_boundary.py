"""The boundary value problem: a closed form, measured orders, and messages of failures."""

from dataclasses import replace

import numpy as np
import pytest

from armdyn.optimal.problem.status import Status, Stop
from armdyn.paper.indirect.boundary import BoundaryExtremal, BoundaryProblem, solve_lobatto, solve_trapezoidal
from armdyn.paper.indirect.canonical import canonical_system, columns
from problems import cart, paper_problem

NONE = np.array([np.inf])


def cart_problem(distance, weight):
    """∫ (1 + w/2 u²) dt on the double integrator, from rest to rest, with a poor guess."""
    s = np.linspace(0, 1, 9)
    q, v = distance * s, np.full(s.size, distance)
    guess = BoundaryExtremal(s, np.array([q, v, -np.ones(s.size), 2 * s - 1]), 1.0)
    ends = np.array([0.0, 0.0]), np.array([distance, 0.0])
    return BoundaryProblem(canonical_system(cart()), *ends, weight, -NONE, NONE, guess, Stop())


def arm_problem(intervals):
    """The paper's R arm with w = 1, its guess solved beforehand, on an even mesh."""
    problem = paper_problem("r", effort_weight=1.0)
    s = np.linspace(0, 1, 101)
    swing = problem.q_start[0] + (problem.q_goal[0] - problem.q_start[0]) * (3 * s**2 - 2 * s**3)
    guess = BoundaryExtremal(s, np.array([swing, 34 * s * (1 - s), -0.5 + 0 * s, 0.1 * (2 * s - 1)]), 0.3)
    system = canonical_system(problem.robot)
    boundary = BoundaryProblem(system, problem.x_start, problem.x_goal, 1.0, -NONE, NONE, guess, Stop())
    exact = solve_lobatto(boundary, 1e-10, 20_000)
    assert exact.status is Status.SOLVED, exact.message
    s = np.linspace(0, 1, intervals + 1)
    y = np.array([np.interp(s, exact.s, row) for row in exact.y])
    return replace(boundary, guess=BoundaryExtremal(s, y, exact.duration)), exact


@pytest.mark.parametrize("distance", [0.5, 2.0])
@pytest.mark.parametrize("weight", [0.3, 1.0])
@pytest.mark.parametrize("method", ["lobatto", "trapezoidal"])
def test_double_integrator_in_closed_form(distance, weight, method):
    problem = cart_problem(distance, weight)
    # u falls linearly from 6d/T² to its negative; J = T + 6 w d²/T³ is least at T⁴ = 18 w d².
    duration = (18 * weight * distance**2) ** 0.25
    if method == "lobatto":
        found, close = solve_lobatto(problem, 1e-8, 2000), 1e-9  # the solution is a cubic: exact but for rounding
    else:
        found, close = solve_trapezoidal(problem, 200, 1e-10), 5e-5  # 1/200² of second order
    assert found.status is Status.SOLVED, found.message
    assert found.duration == pytest.approx(duration, rel=close)
    u = 6 * distance / duration**2 * (1 - 2 * found.s)
    np.testing.assert_allclose(found.y[3], -weight * u, atol=2 * close * np.max(np.abs(weight * u)))
    np.testing.assert_allclose(found.y[2], -12 * weight * distance / duration**3, rtol=4 * close)


def test_trapezoidal_rule_is_of_order_two():
    meshes = np.array([25, 50, 100, 200])
    errors = []
    for intervals in meshes:
        problem, exact = arm_problem(intervals)
        found = solve_trapezoidal(problem, intervals, 1e-11)
        assert found.status is Status.SOLVED, found.message
        errors.append(abs(found.duration - exact.duration))
    order = -np.polyfit(np.log(meshes), np.log(errors), 1)[0]
    assert order == pytest.approx(2, abs=0.1)  # a regression over a factor of eight; 2.00 measured


def test_lobatto_is_of_order_four():
    meshes = np.array([10, 20, 40])
    errors = []
    for intervals in meshes:
        problem, exact = arm_problem(intervals)
        # No node may be added: the answer is that of the mesh given, solved to rounding.
        found = solve_lobatto(problem, 1e-12, intervals + 1)
        assert found.s.size == intervals + 1
        errors.append(abs(found.duration - exact.duration))
    order = -np.polyfit(np.log(meshes), np.log(errors), 1)[0]
    assert order == pytest.approx(4, abs=0.3)  # a regression over a factor of four, from ten intervals on


def test_h_is_constant_along_a_solution():
    problem, exact = arm_problem(20)
    h = columns(problem.system.terminal, exact.y, *problem.constants)[0]
    assert np.max(np.abs(h)) < 1e-9  # of H's terms, of which the smallest, that of time, is 1


def test_jacobians_against_finite_differences():
    problem, _ = arm_problem(4)
    problem = replace(problem, guess=replace(problem.guess, y=problem.guess.y * 1.1))
    z, p, step = problem.guess.y / problem.scale[:, None], np.array([1.05]), 1e-6
    by_z, by_p = problem.jacobian(problem.guess.s, z, p)
    first, last, by_time = problem.ends_jacobian(z[:, 0], z[:, -1], p)

    def rate(z, p):
        return problem.rate(problem.guess.s, z, p)

    for i, e in enumerate(np.eye(4)):
        numbers = (rate(z + step * e[:, None], p) - rate(z - step * e[:, None], p)) / (2 * step)
        np.testing.assert_allclose(by_z[:, i], numbers, rtol=1e-6, atol=1e-6)  # step² and rounding over step
        for derivative, shift in ((first, (e, 0 * e)), (last, (0 * e, e))):
            up, down = (
                problem.ends(z[:, 0] + side * step * shift[0], z[:, -1] + side * step * shift[1], p) for side in (1, -1)
            )
            np.testing.assert_allclose(derivative[:, i], (up - down) / (2 * step), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(by_p[:, 0], (rate(z, p + step) - rate(z, p - step)) / (2 * step), rtol=1e-6, atol=1e-6)
    assert not np.any(by_time)


def test_a_mesh_that_may_not_grow_is_no_solution():
    problem, _ = arm_problem(10)
    found = solve_lobatto(problem, 1e-8, 11)
    assert found.status is Status.ITERATION_LIMIT
    assert "nodes" in found.message and "of the duration" in found.message


@pytest.mark.parametrize("solve", [lambda p: solve_lobatto(p, 1e-6, 500), lambda p: solve_trapezoidal(p, 50, 1e-8)])
def test_hopeless_guess_and_stop_are_reported(solve):
    problem, _ = arm_problem(10)
    wild = replace(problem, guess=replace(problem.guess, y=-50 * problem.guess.y))
    found = solve(wild)
    assert found.status in (Status.FAILED, Status.ITERATION_LIMIT), found.message
    assert "residual" in found.message
    late = solve(replace(problem, stop=Stop(deadline=0.0)))
    assert late.status is Status.TIME_LIMIT
    assert solve(replace(problem, stop=Stop(interrupted=True))).status is Status.INTERRUPTED


def test_a_stop_keeps_the_results_so_far():
    problem, _ = arm_problem(10)
    late = replace(problem, guess=replace(problem.guess, y=1.1 * problem.guess.y), stop=Stop(deadline=0.0))
    rough, even = solve_lobatto(late, 1e-6, 500), solve_trapezoidal(late, 20, 1e-8)
    for found in (rough, even):
        assert found.message.startswith("time limit")
        assert found.duration == late.guess.duration
    assert np.array_equal(rough.y, late.guess.y) and rough.residual == np.inf
    assert even.s.size == 21 and 0 < even.residual < np.inf


def test_a_singular_jacobian_is_reported():
    problem, _ = arm_problem(10)
    # No costates: nothing that H or the torque depend on moves them.
    y = np.vstack([problem.guess.y[:2], np.zeros((2, 11))])
    found = solve_trapezoidal(replace(problem, guess=replace(problem.guess, y=y)), 20, 1e-8)
    assert found.status is Status.FAILED, found.message
