import casadi as ca
import numpy as np
import pytest

import armdyn as ad
from armdyn.dynamics import Dynamics
from armdyn.errors import ProblemError
from armdyn.optimal.direct import DirectOptions, solve_on_mesh
from armdyn.optimal.monitor import Stop
from armdyn.optimal.staged import build_staged, solve_staged
from armdyn.optimal.starts import spline
from armdyn.optimal.transcription import Scheme
from problems import cart, paper_arm, paper_problem

METHODS = ["lobatto3", "radau2", "radau3", "gauss2", "gauss3"]


def both(problem, scheme, intervals=50, **options):
    """What IPOPT and fatrop make of the straight guess on one mesh."""
    dynamics, guess = Dynamics(problem.robot, free_last_body=True), spline(problem, [])
    options = DirectOptions(**options)
    return [
        solve(problem, guess, dynamics, scheme, intervals, options, Stop()) for solve in (solve_on_mesh, solve_staged)
    ]


def assert_same(ipopt, fatrop, scale):
    """The two optima on one mesh are the same motion."""
    assert ipopt.status is ad.Status.SOLVED
    assert fatrop.status is ad.Status.SOLVED, fatrop.message
    assert fatrop.worst_violation is None
    # Both stop at 1e-8 of the scaled problem.
    assert fatrop.trajectory.duration == pytest.approx(ipopt.trajectory.duration, rel=1e-6)
    np.testing.assert_allclose(fatrop.trajectory.q, ipopt.trajectory.q, atol=1e-4 * scale)
    # Each arc is saturated in both; how the one interval with a switch shares its torque is the least determined.
    np.testing.assert_allclose(fatrop.trajectory.tau, ipopt.trajectory.tau, atol=1e-2 * np.ptp(ipopt.trajectory.tau))


@pytest.mark.parametrize("form", ["forward", "inverse"])
@pytest.mark.parametrize("method", METHODS)
def test_one_link_as_with_ipopt(method, form):
    assert_same(*both(paper_problem("r"), Scheme(method, "constant", form)), scale=1.7)


def test_two_links_as_with_ipopt():
    assert_same(*both(paper_problem("rr"), Scheme("lobatto3", "constant", "forward")), scale=1.7)


@pytest.mark.parametrize("method", METHODS)
def test_double_integrator_as_with_ipopt(tmp_path, method):
    problem = ad.MinimumTimeProblem(cart(tmp_path), q_start=[0.0], q_goal=[2.0])
    ipopt, fatrop = both(problem, Scheme(method, "constant", "forward"), intervals=21)
    assert_same(ipopt, fatrop, scale=2.0)
    # Unit force and mass over 2 m: 2√2 s, from above because constant force keeps its bound.
    assert -1e-7 < fatrop.trajectory.duration - 2 * np.sqrt(2) < 5e-3


def test_velocity_limit_and_moving_ends():
    problem = paper_problem("r", velocity_limit=12.0, v_start=[3.0], v_goal=[-1.0])
    ipopt, fatrop = both(problem, Scheme("radau3", "constant", "forward"))
    assert_same(ipopt, fatrop, scale=1.7)
    assert np.max(np.abs(fatrop.trajectory.v)) <= 12 * (1 + 1e-7)  # relaxed bounds
    np.testing.assert_allclose(fatrop.trajectory.v[[0, -1], 0], [3, -1], atol=1e-9)


@pytest.mark.parametrize("method", METHODS)
def test_derivatives_are_those_of_the_whole(method):
    """Blocks put in place equal CasADi's derivatives of the whole program, which knows no stages."""
    nlp = build_staged(Dynamics(paper_arm("rr"), free_last_body=True), Scheme(method, "constant", "inverse"), 4)
    x, p, f, g = (nlp.functions[name] for name in "xpfg")
    assert sum(nlp.states) + sum(nlp.controls) == x.numel()
    assert sum(nlp.states[1:]) + sum(nlp.constraints) == g.numel()
    random = np.random.default_rng(0)
    at = random.normal(size=x.numel()), random.uniform(0.5, 2, size=p.numel())
    weights = random.normal(), random.normal(size=g.numel())
    sigma, lam = ca.MX.sym("sigma"), ca.MX.sym("lam", g.numel())
    hessian, gradient = ca.hessian(sigma * f + ca.dot(lam, g), x)
    whole = ca.Function("whole", [x, p, sigma, lam], [ca.jacobian(g, x), gradient, hessian])(*at, *weights)
    ours = [nlp.jacobian(*at)[1], *nlp.hessian(*at, *weights)]
    for expected, found in zip(whole, ours, strict=True):
        # The same operations in another order: a few ulp of the largest entry.
        assert np.max(np.abs((found - expected).full())) < 1e-12 * np.max(np.abs(expected.full()))


def test_failure_is_reported_not_raised():
    _, fatrop = both(paper_problem("rr"), Scheme("lobatto3", "constant", "forward"), max_iterations=3)
    assert fatrop.status is ad.Status.ITERATION_LIMIT
    assert fatrop.iterations == 3
    assert fatrop.worst_violation is not None
    assert fatrop.trajectory.duration > 0


def test_nothing_starts_when_it_is_time_to_stop():
    problem, scheme = paper_problem("r"), Scheme("lobatto3", "constant", "forward")
    for stop, status in ((Stop(deadline=0.0), ad.Status.TIME_LIMIT), (Stop(interrupted=True), ad.Status.INTERRUPTED)):
        guess = spline(problem, [])
        attempt = solve_staged(
            problem, guess, Dynamics(problem.robot, free_last_body=True), scheme, 10, DirectOptions(), stop
        )
        assert attempt.status is status
        assert attempt.iterations == 0
        assert attempt.trajectory.duration == pytest.approx(guess.duration)


def test_linear_torque_is_refused():
    with pytest.raises(ProblemError, match="constant"):
        build_staged(Dynamics(paper_arm("r"), free_last_body=True), Scheme("lobatto3", "linear"), 5)
