"""Quadratic programs of one step: against a dense solution by scipy, and rows that no step can reach."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import minimize

from armdyn.optimal.flat.convex_step import ConvexStep, SoftRows, solve_step


def program(random, upper):
    n, m = 6, 30
    hard = sp.csr_matrix(random.normal(size=(m, n)))
    soft = sp.csr_matrix(random.normal(size=(m, n)))
    return ConvexStep(
        gradient=random.normal(size=n),
        curvature=sp.identity(n, format="csc") * 0.1,
        lower=np.full(n, -0.5),
        upper=np.full(n, 0.5),
        hard=(hard, random.uniform(0.1, upper, m)),
        soft=(SoftRows(soft, random.uniform(-0.1, upper, m), np.arange(m) // 3, 0.7),),
    )


def test_a_program_against_another_solver():
    random = np.random.default_rng(3)
    for _ in range(5):
        problem = program(random, 1.0)
        (rows,), slacks = problem.soft, 10

        def cost(z, problem=problem, rows=rows):
            return problem.gradient @ z[:6] + z[:6] @ (problem.curvature @ z[:6]) / 2 + rows.price * np.sum(z[6:])

        kept = [
            {"type": "ineq", "fun": lambda z, p=problem: p.hard[1] - p.hard[0] @ z[:6]},
            {"type": "ineq", "fun": lambda z, r=rows: r.upper - r.jacobian @ z[:6] + z[6:][r.groups]},
        ]
        bounds = [(-0.5, 0.5)] * 6 + [(0, None)] * slacks
        other = minimize(cost, np.zeros(6 + slacks), bounds=bounds, constraints=kept, options={"maxiter": 500})
        found = solve_step(problem, 1.0)
        assert found.found and other.success
        np.testing.assert_allclose(found.cost, other.fun, atol=1e-6)  # SLSQP's own tolerance


def test_rows_beyond_reach_change_nothing_and_have_no_multiplier():
    problem = program(np.random.default_rng(5), 1.0)
    far = np.full(30, 10.0)  # no step within half a unit reaches so far
    (rows,) = problem.soft
    wide = ConvexStep(
        problem.gradient,
        problem.curvature,
        problem.lower,
        problem.upper,
        (sp.vstack([problem.hard[0], problem.hard[0]], format="csr"), np.append(problem.hard[1], far)),
        (rows,),
    )
    alone, both = solve_step(problem, 1.0), solve_step(wide, 1.0)
    np.testing.assert_allclose(both.step, alone.step, atol=1e-9)
    np.testing.assert_allclose(both.multipliers[0], np.append(alone.multipliers[0], np.zeros(30)), atol=1e-9)


@pytest.mark.parametrize("near", [0.0, 0.3])
def test_rows_that_are_left_out_at_first_are_put_back(near):
    random = np.random.default_rng(7)
    equal = SoftRows(sp.csr_matrix(random.normal(size=(1, 6))), np.array([0.05]), np.arange(1), 0.7)
    problem = replace(program(random, 1.0), equal=equal)
    whole, found = solve_step(problem, 1.0), solve_step(problem, near)
    assert np.count_nonzero(whole.multipliers[0] > 1e-3) and np.count_nonzero(whole.multipliers[1] > 1e-3)
    np.testing.assert_allclose(found.step, whole.step, atol=1e-7)
    for own, other in zip(found.multipliers, whole.multipliers, strict=True):
        np.testing.assert_allclose(own, other, atol=1e-6)
