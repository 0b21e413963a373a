"""One IPOPT for all: its options, its stop, and shared solvers."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pytest

from armdyn.codegen.deadline import NoTimeError
from armdyn.optimal.mesh.assembly import Program
from armdyn.optimal.mesh.ipopt import Ipopt, NlpData, _options, ipopt_for
from armdyn.optimal.problem.options import Acceptable, SolverSettings
from armdyn.optimal.problem.status import Status, Stop
from armdyn.optimal.problem.task import Task
from problems import paper_problem

FREE = np.full(2, -np.inf), np.full(2, np.inf)
SETTINGS = SolverSettings(1e-10, 100)


@dataclass(frozen=True)
class Shape:
    """Of a Rosenbrock valley on a line."""

    steepness: float


def valley(shape):
    """Minimise (p - x)² + s (y - x²)² so that x + y = 2."""
    x, p, sigma, lam = ca.MX.sym("x", 2), ca.MX.sym("p"), ca.MX.sym("sigma"), ca.MX.sym("lam")
    f = (p - x[0]) ** 2 + shape.steepness * (x[1] - x[0] ** 2) ** 2
    g = x[0] + x[1] - 2
    return Program(
        functions={"x": x, "p": p, "f": f, "g": g},
        jacobian=ca.Function("nlp_jac_g", [x, p], [g, ca.jacobian(g, x)], ["x", "p"], ["g", "jac_g_x"]),
        hessian=ca.Function(
            "nlp_hess_l",
            [x, p, sigma, lam],
            [ca.triu(ca.hessian(sigma * f + lam * g, x)[0])],
            ["x", "p", "lam_f", "lam_g"],
            ["triu_hess_gamma_x_x"],
        ),
    )


def solve(solver, start=(-1.2, 1.0), x_bounds=FREE, stop=None, p=1.0):
    zero = np.zeros(1)
    return solver.solve(NlpData(np.array(start), np.array([p]), x_bounds, (zero, zero)), stop or Stop())


def test_a_solution_its_multipliers_and_its_equations():
    solver = Ipopt(valley(Shape(100.0)), SETTINGS)
    found = solve(solver, start=(0.5, 1.5))  # the line crosses the valley twice
    assert found.status is Status.SOLVED and found.message == "Solve Succeeded" and found.iterations > 2
    np.testing.assert_allclose(found.x, [1, 1], atol=1e-9)
    np.testing.assert_allclose(found.lam_g, 0, atol=1e-7)  # the valley's own minimum is on the line
    np.testing.assert_allclose(solver.equations(np.array([2.0, 3.0]), np.array([1.0])), [3.0])


def test_words_for_failures():
    solver = Ipopt(valley(Shape(100.0)), SETTINGS)
    assert solve(Ipopt(valley(Shape(100.0)), SolverSettings(1e-10, 2))).status is Status.ITERATION_LIMIT
    assert solve(solver, x_bounds=(FREE[0], np.zeros(2))).status is Status.INFEASIBLE


def test_unknowns_are_finite_always():
    start = np.array([-1.2, 1.0])
    found = solve(Ipopt(valley(Shape(100.0)), SETTINGS), start, p=np.nan)
    assert found.status is Status.FAILED
    assert np.all(np.isfinite(found.x))


def test_a_stop_is_polled_in_its_own_call_only():
    solver = Ipopt(valley(Shape(100.0)), SETTINGS)
    interrupted, late = solve(solver, stop=Stop(interrupted=True)), solve(solver, stop=Stop(deadline=0.0))
    assert interrupted.status is Status.INTERRUPTED and interrupted.message == "interrupted"
    assert late.status is Status.TIME_LIMIT and late.message == "time limit reached"
    assert solve(solver).status is Status.SOLVED


def test_built_once_for_the_same_arguments_and_settings():
    first = ipopt_for(SETTINGS, valley, Shape(10.0))
    assert ipopt_for(SolverSettings(1e-10, 100), valley, Shape(10.0)) is first
    assert ipopt_for(SETTINGS, valley, Shape(20.0)) is not first
    assert ipopt_for(SolverSettings(1e-9, 100), valley, Shape(10.0)) is not first


def test_settings_are_ipopts_options():
    near = SolverSettings(1e-10, 60, barrier=1e-9, push=1e-9)
    known = {"tol": 1e-10, "max_iter": 60, "mu_init": 1e-9}
    assert known.items() | {("bound_push", 1e-9), ("bound_frac", 1e-9)} <= _options(near).items()
    warm = _options(SolverSettings(1e-7, 60, acceptable=Acceptable(1e-5, 1e-6, 1e-7, 8), push=1e-9, warm=True))
    assert (warm["acceptable_tol"], warm["acceptable_constr_viol_tol"], warm["acceptable_obj_change_tol"]) == (
        1e-5,
        1e-6,
        1e-7,
    )
    assert warm["warm_start_init_point"] == "yes" and warm["warm_start_mult_bound_push"] == 1e-9
    assert "bound_push" not in warm and warm["mu_init"] == 0.1  # IPOPT's own


def test_it_prints_nothing(capfd):
    zeros = np.zeros(2)  # fixed unknowns and an equation, of which CasADi would warn
    solve(Ipopt(valley(Shape(100.0)), SolverSettings(1e-10, 100)), x_bounds=(zeros, zeros))
    assert not "".join(capfd.readouterr())


def test_without_time_to_compile_it_is_built_without():
    task, modes = Task.of(paper_problem("r"), stop=Stop(deadline=0.0)), []

    def build(scheme):
        modes.append(scheme.compile)
        if scheme.compile is not False:
            raise NoTimeError
        return scheme

    for _ in range(2):
        assert task.in_time(build).compile is False
    assert modes == [None, False, False]  # it is not tried again and again


class _Breaks(Stop):
    """A stop that fails, as a second Ctrl-C does."""

    def __bool__(self):
        raise KeyboardInterrupt


def test_an_exception_of_a_stop_ends_the_solve_and_is_raised_silently(capfd):
    solver = Ipopt(valley(Shape(100.0)), SETTINGS)
    with pytest.raises(KeyboardInterrupt):
        solve(solver, stop=_Breaks())
    assert capfd.readouterr() == ("", "")
    assert solve(solver, start=(0.5, 1.5)).status is Status.SOLVED


def test_failed_solves_print_nothing(capfd):
    assert solve(Ipopt(valley(Shape(100.0)), SolverSettings(1e-10, 1))).status is Status.ITERATION_LIMIT
    assert solve(Ipopt(valley(Shape(100.0)), SETTINGS), x_bounds=(np.zeros(2), np.zeros(2))).status is Status.INFEASIBLE
    assert solve(Ipopt(valley(Shape(100.0)), SETTINGS), p=np.nan).status is Status.FAILED
    assert capfd.readouterr() == ("", "")
