"""Newton's method: known roots, falling residuals, and every way in which it ends."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armdyn.optimal.problem.status import Status, Stop
from armdyn.paper.indirect.newton import Point, SingularError, newton

HOW = {"tolerance": 1e-12, "steps": 60, "shortest": 2.0**-10}
number = st.floats(-3, 3)


def system(function, jacobian):
    """Equations with a dense solver, and a list of the points at which they were evaluated."""
    calls = []

    def equations(x):
        calls.append(x.copy())
        residual = np.atleast_1d(function(x))

        def step():
            try:
                return np.linalg.solve(np.atleast_2d(jacobian(x)), -residual)
            except np.linalg.LinAlgError as error:
                raise SingularError from error

        return Point(residual, step)

    return equations, calls


def never():
    raise AssertionError("no step is needed")


@settings(deadline=None)
@given(st.lists(number, min_size=12, max_size=12))
def test_linear_equations_take_one_step(numbers):
    values = np.array(numbers)
    matrix, root = values[:9].reshape(3, 3) + 10 * np.eye(3), values[9:]
    equations, _ = system(lambda x: matrix @ (x - root), lambda x: matrix)
    found = newton(equations, np.zeros(3), **HOW)
    assert found.status is Status.SOLVED and found.steps <= 2  # the second, if any, is of rounding
    np.testing.assert_allclose(found.unknowns, root, atol=1e-12)


@settings(deadline=None)
@given(st.lists(st.floats(1e-2, 1e2), min_size=1, max_size=4), st.floats(1e-2, 1e2))
def test_square_roots_from_any_positive_guess(squares, guess):
    a = np.array(squares)
    equations, calls = system(lambda x: x**2 / a - 1, lambda x: np.diag(2 * x / a))
    found = newton(equations, np.full(a.size, guess), positive=a.size, **HOW)
    assert found.status is Status.SOLVED, found.reason
    np.testing.assert_allclose(found.unknowns, np.sqrt(a), rtol=1e-12)
    assert np.all(np.array(calls) > 0)


@settings(deadline=None)
@given(number, number)
def test_a_curved_valley_is_followed_downward(x, y):
    # Rosenbrock's: of the full step from (-1.2, 1) the residual is twenty times the guess's.
    equations, calls = system(
        lambda z: np.array([10 * (z[1] - z[0] ** 2), 1 - z[0]]), lambda z: np.array([[-20 * z[0], 10], [-1, 0]])
    )
    found = newton(equations, np.array([x, y]), **HOW)
    assert found.status is Status.SOLVED, found.reason
    np.testing.assert_allclose(found.unknowns, [1, 1], atol=1e-11)
    norms = [np.linalg.norm(equations(z).residual) for z in tuple(calls)]
    assert found.steps < len(norms)
    assert np.linalg.norm(found.residual) == min(norms)


@settings(deadline=None)
@given(st.floats(1.5, 50))
def test_steps_are_shortened_where_full_ones_diverge(start):
    # |arctan| grows under full steps from beyond 1.39.
    equations, calls = system(np.arctan, lambda x: 1 / (1 + x**2))
    found = newton(equations, np.array([start]), **HOW)
    assert found.status is Status.SOLVED, found.reason
    assert abs(found.unknowns[0]) < 1e-12
    assert len(calls) - 1 > found.steps


def test_a_stiff_function_takes_its_steps_and_can_go_on():
    equations, _ = system(lambda x: np.expm1(40 * x), lambda x: 40 * np.exp(40 * x))
    start = np.array([1.0])
    whole = newton(equations, start, **HOW)
    assert whole.status is Status.SOLVED and 40 <= whole.steps <= 50  # 1/40 each, then of second order
    short = newton(equations, start, **(HOW | {"steps": 20}))
    assert short.status is Status.ITERATION_LIMIT and short.steps == 20 and "used up" in short.reason
    rest = newton(equations, short.unknowns, **HOW)
    assert rest.steps == whole.steps - 20
    assert np.array_equal(rest.unknowns, whole.unknowns)


def test_it_is_of_second_order():
    equations, calls = system(lambda x: np.exp(x) - 2, np.exp)
    newton(equations, np.array([1.0]), **HOW)
    error = np.abs(np.array(calls)[:4, 0] - np.log(2))
    # e_{k+1} = F''/(2F') e_k², which is ½ at the root.
    np.testing.assert_allclose(error[2:] / error[1:-1] ** 2, 0.5, rtol=0.05)


def test_a_root_takes_no_step():
    found = newton(lambda x: Point(np.zeros(2), never), np.ones(2), **HOW)
    assert found.status is Status.SOLVED and found.steps == 0
    assert np.array_equal(found.unknowns, np.ones(2))


@pytest.mark.parametrize("start", [1e-9, 1.0, 3.0])
def test_where_no_root_is_it_gets_stuck_or_singular(start):
    equations, _ = system(lambda x: x**2 + 1, lambda x: 2 * x)
    found = newton(equations, np.array([start]), **HOW)
    assert found.status is Status.FAILED
    assert "stuck" in found.reason or "singular" in found.reason
    assert found.residual[0] == found.unknowns[0] ** 2 + 1


def test_a_singular_jacobian_is_reported():
    equations, calls = system(lambda x: np.array([x[0] + x[1], x[0] + x[1] - 1]), lambda x: np.ones((2, 2)))
    found = newton(equations, np.zeros(2), **HOW)
    assert found.status is Status.FAILED and "singular" in found.reason
    assert found.steps == 0 and len(calls) == 1


def test_a_step_to_nan_is_rejected():
    equations, _ = system(lambda x: np.where(x < 0, np.nan, x - 1), lambda x: np.array([[1e-3]]))
    found = newton(equations, np.array([2.0]), **(HOW | {"shortest": 0.5}))
    assert found.status is Status.FAILED and "stuck" in found.reason
    assert found.unknowns[0] == 2.0


@settings(deadline=None)
@given(st.floats(0.1, 10), st.floats(0.1, 10))
def test_positive_unknowns_stay_positive(x, y):
    # The root is at −1 for the second one, which must stay positive; the first is free.
    equations, calls = system(lambda z: np.array([z[0] + 1, z[1] + 1]), lambda z: np.eye(2))
    found = newton(equations, np.array([x, y]), positive=1, **HOW)
    assert found.status is not Status.SOLVED
    # At most nine tenths of the way to zero, up to rounding.
    assert all(z[1] > 0 for z in calls) and calls[1][1] >= 0.1 * y * (1 - 1e-9)


def test_a_stop_is_obeyed_before_the_next_step():
    late = newton(lambda x: Point(x, never), np.ones(1), stop=Stop(deadline=0.0), **HOW)
    assert late.status is Status.TIME_LIMIT and late.reason == "time limit"
    assert late.steps == 0 and late.unknowns[0] == 1
    stop = Stop()
    inner, calls = system(lambda x: np.expm1(40 * x), lambda x: 40 * np.exp(40 * x))

    def equations(x):
        if len(calls) == 5:
            stop.interrupt()
        return inner(x)

    found = newton(equations, np.array([1.0]), stop=stop, **HOW)
    assert found.status is Status.INTERRUPTED and found.reason == "interrupted"
    assert found.steps == 5
    assert found.unknowns[0] == calls[5][0]
    root = newton(lambda x: Point(np.zeros(1), never), np.ones(1), stop=stop, **HOW)
    assert root.status is Status.SOLVED  # a found root counts, however late
