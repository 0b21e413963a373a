"""Quadratic programs of one step: held against the conditions that a convex program's solution alone satisfies.

Sequences of steps: held against one further step.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import minimize

import armdyn as ad
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve_program import curve_program
from armdyn.optimal.curves.layout import CurveSpec, curve_layout
from armdyn.optimal.curves.nlp_data import assemble_curve
from armdyn.optimal.curves.planned_paths import guesses_along, paths_through
from armdyn.optimal.curves.sequential import ConvexStep, Sequential, SoftRows, solve_step
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.task import Task

accurately = partial(solve_step, accuracy=1e-8)  # ten times as accurate as the conditions


def program(random, n=6, rows=30, upper=1.0, together=3, wide=6):
    """Rows on a few neighbouring unknowns and on the last one, as those of a curve."""

    def jacobian():
        first = random.integers(0, n - wide + 1, rows)
        index = np.hstack([first[:, None] + np.arange(wide), np.full((rows, 1), n - 1)])
        values = random.normal(size=index.shape)
        return sp.csr_matrix((values.ravel(), (np.repeat(np.arange(rows), wide + 1), index.ravel())), (rows, n))

    return ConvexStep(
        place=np.arange(n, dtype=np.int32),
        gradient=random.normal(size=n),
        curvature=sp.identity(n, format="csr") * 0.1,
        squares=(jacobian(), random.uniform(0, 0.1, rows)),
        bounds=(np.full(n, -0.5), np.full(n, 0.5)),
        hard=((jacobian(),), random.uniform(0.1, upper, rows)),
        soft=(SoftRows((jacobian(),), random.uniform(-0.1, upper, rows), np.arange(rows) // together, 0.7),),
    )


def expect_solution(problem, found, accuracy=1e-7):
    """Karush, Kuhn and Tucker: feasible, stationary, complementary; the cost is the step's."""
    ((hard,), top), (rows,), (lower, upper) = problem.hard, problem.soft, problem.bounds
    (soft,) = rows.jacobian
    curvature = problem.curvature + problem.squares[0].T @ sp.diags(problem.squares[1]) @ problem.squares[0]
    step, (of_hard, of_soft) = found.step, found.multipliers
    change = soft @ step - rows.upper
    slack = np.zeros(int(np.max(rows.groups)) + 1)
    np.maximum.at(slack, rows.groups, change)
    assert found.found
    assert np.max(hard @ step - top) < accuracy
    assert np.min(step - lower) > -accuracy and np.min(upper - step) > -accuracy
    slope = problem.gradient + curvature @ step + hard.T @ of_hard + soft.T @ of_soft + found.bounds
    np.testing.assert_allclose(slope, 0, atol=accuracy)
    assert min(np.min(of_hard), np.min(of_soft)) >= 0
    paid = np.bincount(rows.groups, of_soft)
    assert np.max(paid) < rows.price + accuracy
    np.testing.assert_allclose(of_hard * (top - hard @ step), 0, atol=accuracy)
    np.testing.assert_allclose(of_soft * (slack[rows.groups] - change), 0, atol=accuracy)
    np.testing.assert_allclose(slack * (rows.price - paid), 0, atol=accuracy)
    at = np.where(found.bounds > 0, upper, lower)
    np.testing.assert_allclose(found.bounds * (at - step), 0, atol=accuracy)
    cost = problem.gradient @ step + step @ (curvature @ step) / 2 + rows.price * np.sum(slack)
    np.testing.assert_allclose(found.cost, cost, atol=accuracy)


@pytest.mark.parametrize(("n", "rows", "together"), [(6, 30, 3), (200, 500, 1), (200, 500, 14), (40, 0, 1)])
def test_the_conditions_of_a_solution_hold(n, rows, together):
    random = np.random.default_rng(n + together)
    for _ in range(5):
        problem = program(random, n, max(rows, 1), together=together)
        expect_solution(problem, accurately(problem))


def test_a_program_against_another_solver():
    problem, slacks = program(np.random.default_rng(3)), 10
    problem = replace(problem, squares=(problem.squares[0][:0], np.empty(0)))
    (rows,) = problem.soft

    def cost(z):
        return problem.gradient @ z[:6] + z[:6] @ (problem.curvature @ z[:6]) / 2 + rows.price * np.sum(z[6:])

    kept = [
        {"type": "ineq", "fun": lambda z: problem.hard[1] - problem.hard[0][0] @ z[:6]},
        {"type": "ineq", "fun": lambda z: rows.upper - rows.jacobian[0] @ z[:6] + z[6:][rows.groups]},
    ]
    bounds = [(-0.5, 0.5)] * 6 + [(0, None)] * slacks
    other = minimize(cost, np.zeros(6 + slacks), bounds=bounds, constraints=kept, options={"maxiter": 500})
    assert other.success
    np.testing.assert_allclose(accurately(problem).cost, other.fun, atol=1e-6)  # SLSQP's own tolerance


def test_rows_beyond_reach_change_nothing_and_have_no_multiplier():
    problem = program(np.random.default_rng(5))
    alone = accurately(problem)
    for far in (20.0, np.inf):  # no step within half a unit reaches so far
        wide = replace(problem, hard=(2 * problem.hard[0], np.append(problem.hard[1], np.full(30, far))))
        both = accurately(wide)
        np.testing.assert_array_equal(both.step, alone.step)
        np.testing.assert_array_equal(both.multipliers[0], np.append(alone.multipliers[0], np.zeros(30)))


def test_equations_are_missed_where_they_cost_too_much():
    problem = program(np.random.default_rng(7))
    either = sp.csr_matrix(np.eye(6)[:1] * np.array([[1.0], [-1.0]]))
    free = float(accurately(problem).step[0])
    for aim, price, missed in ((free + 0.1, 100.0, False), (free + 0.1, 1e-3, True), (free - 0.1, 100.0, False)):
        rows = SoftRows((either,), np.array([aim, -aim]), np.arange(2), price)
        found = accurately(replace(problem, soft=(*problem.soft, rows)))
        assert found.found and (abs(found.step[0] - aim) > 1e-3) == missed


def test_no_step_keeps_rows_that_exclude_each_other():
    problem = program(np.random.default_rng(9))
    both = sp.csr_matrix(np.array([[1.0, 0, 0, 0, 0, 0], [-1.0, 0, 0, 0, 0, 0]]))
    assert not accurately(replace(problem, hard=((both,), np.array([-0.2, -0.2])))).found


def test_unknowns_that_are_fixed_do_not_move_and_the_order_does_not_matter():
    problem, n = program(np.random.default_rng(11), 40, 100, together=4), 40
    held = problem.place.copy()
    held[[3, 17]] = -1
    held[held >= 0] = np.random.default_rng(12).permutation(n - 2)
    found = accurately(replace(problem, place=held))
    assert found.found and not np.any(found.step[[3, 17]])
    lower, upper = (side.copy() for side in problem.bounds)
    lower[[3, 17]], upper[[3, 17]] = -1e-9, 1e-9
    near = accurately(replace(problem, bounds=(lower, upper)))
    np.testing.assert_allclose(found.step, near.step, atol=1e-6)  # the two move by 1e-9


@pytest.mark.slow
def test_along_no_planned_path_does_a_sequence_end_where_a_further_step_saves_time():
    """Into a crate: the third path's first two steps are predicted exactly, then the nearest points are others."""
    wide, thick, high, z = 0.7, 0.04, 0.7, 0.65
    turn, middle = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]]), np.array([0.67, 0.19])
    walls = []
    for side in (-wide / 2, wide / 2):
        for size, offset in (((thick, wide, high), (side, 0)), ((wide, thick, high), (0, side))):
            place = np.eye(4)
            place[:2, :2], place[:3, 3] = turn, [*(middle + turn @ offset), z]
            walls.append(ad.Box(size, place))
    start, goal = [1.57, -1.57, 0, -1.57, -1.57, 3.14], [-1.4409, -0.7788, 1.5149, -2.3148, -1.5624, -0.1718]
    problem = ad.MinimumTimeProblem(ad.Robot.from_library("ur5"), q_start=start, q_goal=goal, obstacles=walls)
    task = Task.of(problem)
    spec, enough = CurveSpec(TightenedConstraints.of(task)), task.policy.sequential.enough
    guesses = list(guesses_along(task, paths_through(problem, 0, task.stop)))
    for guess in guesses:
        shape = curve_layout(problem, guess, spec.constraints)
        data = assemble_curve(task, guess, spec, shape)
        program = curve_program(task, guess, spec, shape, data)
        bounds = tuple(side[program.torques] for side in data.x_bounds)
        loop = Sequential(program, bounds, guess.duration, task.policy.sequential, task.stop)
        found = loop.solve(data.x, enough)
        again = loop.solve(found.at.x, enough, warm=True, steps=1)
        assert found.status is Status.SOLVED
        assert loop.merit(found.at) - loop.merit(again.at) < enough * loop.merit(found.at)  # 20 times that
    assert len(guesses) == 3
