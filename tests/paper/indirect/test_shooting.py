"""Shooting on switching times: a closed form, its Jacobian, a published benchmark, and messages of failures."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.problem.status import Status, Stop
from armdyn.optimal.verify.arc import Arc, Mode
from armdyn.paper import solve_indirect
from armdyn.paper.indirect.bang_bang import BangBangExtremal, BangBangProblem
from armdyn.paper.indirect.canonical import canonical_system
from armdyn.paper.indirect.newton import SingularError
from armdyn.paper.indirect.shooting import ShootingEquations, shoot
from paper.indirect.carts import cart_bang_bang, cart_guess
from problems import luus_problem, paper_problem


def arm_equations():
    """Four arcs of the paper's RR arm, as many as it has states, and a guess that they do not hold."""
    problem, bound = paper_problem("rr"), np.full(2, 3.0)
    system = canonical_system(problem.robot)
    task = BangBangProblem(system, problem.x_start, problem.x_goal, -bound, bound, 1e-10, Stop())
    up, down = Mode.UPPER, Mode.LOWER
    arcs = (Arc(0.06, (up, up)), Arc(0.05, (up, down)), Arc(0.07, (down, down)), Arc(0.04, (down, up)))
    rng = np.random.default_rng(3)
    starts = np.hstack([rng.normal(size=(4, 4)), 0.1 * rng.normal(size=(4, 4))])
    guess = BangBangExtremal(arcs, (1, 0, 1), starts)
    return ShootingEquations.of(task, guess), guess


def test_double_integrator_in_closed_form():
    found = shoot(cart_bang_bang(), cart_guess())
    assert found.status is Status.SOLVED, found.message
    # t_f = 2 √2, half of it on each limit; ρ = ∂(time to go)/∂x.
    np.testing.assert_allclose(found.lengths, np.sqrt(2), rtol=1e-10)
    np.testing.assert_allclose(found.starts[0, 2:], [-1 / np.sqrt(2), -1.0], rtol=1e-9)
    assert found.wrong_sign < 1e-9  # S is zero at the switch but for the tolerance
    t, y = found.t[0], found.y[0]
    np.testing.assert_allclose(y[:, 0], t**2 / 2, atol=1e-12)


def test_unknowns_are_all_but_the_start():
    equations, guess = arm_equations()
    unknowns = equations.unknowns(guess)
    assert unknowns.shape == (4 * 8 - 4 + 4,)
    starts, lengths = equations.parts(unknowns)
    np.testing.assert_array_equal(starts[0, :4] * equations.scale[:4], equations.problem.x_start)
    np.testing.assert_allclose((starts * equations.scale)[1:], guess.starts[1:], rtol=1e-15)
    np.testing.assert_allclose(lengths * equations.time, guess.lengths, rtol=1e-15)
    assert np.max(np.abs(starts[:, 4:])) == 1  # the costates' peaks are the unit


def test_along_its_step_the_residual_falls_by_as_much():
    equations, guess = arm_equations()
    unknowns = equations.unknowns(guess)
    point = equations.at(unknowns, 1e-12)
    assert point.residual.shape == unknowns.shape
    step = point.step()
    h = 1e-5 / np.max(np.abs(step))
    ahead, behind = (equations.at(unknowns + side * h * step, 1e-12).residual for side in (1, -1))
    # Central differences: 1e-10 of third derivatives, and the integrator's 1e-12 over 1e-5.
    slope = (ahead - behind) / (2 * h * np.max(np.abs(step)))
    np.testing.assert_allclose(slope, -point.residual / np.max(np.abs(step)), atol=1e-5 * np.max(np.abs(slope)))


def test_a_singular_jacobian_is_reported():
    problem = cart_bang_bang()
    guess = cart_guess()
    guess = replace(guess, starts=guess.starts * [1, 1, 0, 0])  # no costates: H is 1 for any torque
    equations = ShootingEquations.of(problem, guess)
    stuck = replace(problem, lower=problem.upper)  # no torque jumps: S may be anything
    with pytest.raises(SingularError):
        replace(equations, problem=stuck).at(equations.unknowns(guess), 1e-10).step()
    found = shoot(stuck, guess)
    assert found.status is Status.FAILED and "singular" in found.message


def test_a_way_that_the_modes_cannot_go_is_no_solution():
    found = shoot(cart_bang_bang(), cart_guess(modes=(Mode.LOWER, Mode.UPPER)))
    assert found.status in (Status.FAILED, Status.ITERATION_LIMIT)
    assert "switching times of 2 arcs" in found.message
    assert np.all(found.lengths > 0)


def test_a_stop_is_reported():
    late = shoot(replace(cart_bang_bang(), stop=Stop(deadline=0.0)), cart_guess())
    assert late.status is Status.TIME_LIMIT and "time limit" in late.message


def test_luus_switching_times():
    problem = luus_problem()
    direct = ad.solve_minimum_time(problem)
    found = solve_indirect(problem, direct)
    assert found.success, found.message
    starts = np.cumsum([arc.duration for arc in found.arcs])[:-1]
    # An independent computation, to eight digits.
    np.testing.assert_allclose(starts, [0.94314035, 1.49113997, 2.62754505], atol=1e-8)
    assert found.duration == pytest.approx(direct.duration, rel=1e-9)
