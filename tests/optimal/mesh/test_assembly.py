from dataclasses import replace

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import spsolve

from armdyn.dynamics import Dynamics
from armdyn.optimal.mesh.assembly import build_nlp, scatter
from armdyn.optimal.mesh.layout import Layout, Parameters, to_unknowns
from armdyn.optimal.mesh.starts import Guesses
from armdyn.optimal.problem.options import Scheme
from armdyn.trajectory import Trajectory
from problems import paper_arm

SCHEMES = [Scheme(control) for control in ("linear", "constant")]


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_assembled_derivatives_are_those_of_the_whole(scheme):
    """Interval blocks put in place equal CasADi's derivatives of the whole NLP, which knows no intervals."""
    nlp = build_nlp(Dynamics(paper_arm("rr"), free_last_body=True), scheme, 5)
    x, p, f, g = (nlp.functions[name] for name in "xpfg")
    random = np.random.default_rng(0)
    at = random.normal(size=x.numel()), random.uniform(0.5, 2, size=p.numel())
    sigma, lam = ca.MX.sym("sigma"), ca.MX.sym("lam", g.numel())
    weights = random.normal(), random.normal(size=g.numel())

    whole = ca.Function("J", [x, p], [ca.jacobian(g, x)])(*at)
    scale = np.max(np.abs(whole.full()))
    # The same operations in another order: a few ulp of the largest entry.
    assert np.max(np.abs((nlp.jacobian(*at)[1] - whole).full())) < 1e-13 * scale

    hessian = ca.triu(ca.hessian(sigma * f + ca.dot(lam, g), x)[0])
    whole = ca.Function("H", [x, p, sigma, lam], [hessian])(*at, *weights)
    difference = nlp.hessian(*at, *weights) - whole
    assert np.max(np.abs(difference.full())) < 1e-12 * np.max(np.abs(whole.full()))


@pytest.mark.parametrize("scheme", SCHEMES, ids=str)
def test_defects_vanish_on_a_motion_that_collocation_integrates_exactly(scheme):
    """With no gravity torque change and constant acceleration q is quadratic: no defect but rounding."""
    model = paper_arm("r").model.copy()
    model.gravity.linear = np.zeros(3)
    dynamics = Dynamics(replace(paper_arm("r"), model=model), free_last_body=True)
    tau, t = 0.7, np.linspace(0, 0.4, 9)
    a = float(dynamics.aba([0.0], [0.0], [tau], dynamics.last_body)[0])
    motion = Trajectory(t, (-1 + a * t[:, None] ** 2 / 2), a * t[:, None], np.full((9, 1), tau))
    nlp, layout = build_nlp(dynamics, scheme, 8), Layout(dynamics.nv, scheme)
    by = Parameters(np.full(8, 1 / 8), 0.4, 1.0, 2.5, np.zeros(1), np.array([3.0]), dynamics.last_body)
    (x,) = to_unknowns(Guesses.of(motion), layout, by)
    g = ca.Function("g", [nlp.functions["x"], nlp.functions["p"]], [nlp.functions["g"], nlp.functions["f"]])
    defects, cost = g(x, by.packed())
    # Rounding of numbers of the order of one.
    assert np.max(np.abs(defects.full())) < 1e-14
    assert float(cost) * by.time == pytest.approx(0.4, rel=1e-14)


SIZES = st.tuples(st.integers(1, 6), st.integers(1, 5))


@given(SIZES, st.data())
def test_scattered_nonzeros_are_a_dense_sum(shape, data):
    count = data.draw(st.integers(1, 20))
    rows, cols = (np.array(data.draw(st.lists(st.integers(0, n - 1), min_size=count, max_size=count))) for n in shape)
    values = np.array(data.draw(st.lists(st.integers(-9, 9), min_size=count, max_size=count)), dtype=float)
    expected = np.zeros(shape)
    np.add.at(expected, (rows, cols), values)
    symbols = ca.MX.sym("v", count)
    matrix = ca.Function("f", [symbols], [scatter(rows, cols, shape, symbols)])(values)
    assert matrix.nnz() == len({*zip(rows, cols, strict=True)})
    np.testing.assert_array_equal(matrix.full(), expected)  # small whole numbers: exact


@pytest.fixture(scope="module")
def swing():
    """RR from a bent pose at rest with constant torque and for a given time, by DOP853."""
    robot, tau, duration = paper_arm("rr"), np.array([1.0, -0.3]), 0.2
    model, data = robot.model, robot.model.createData()
    q, v = np.array([-1.0, 0.4]), np.zeros(2)

    def rate(t, x):
        return np.concatenate([x[2:], pin.aba(model, data, x[:2], x[2:], tau)])

    t = np.linspace(0, duration, 65)
    x = solve_ivp(rate, (0, duration), np.concatenate([q, v]), "DOP853", t_eval=t, rtol=1e-13, atol=1e-14).y.T
    return robot, Trajectory(t, x[:, :2], x[:, 2:], np.tile(tau, (t.size, 1)))


@pytest.mark.parametrize("control", ["constant", "linear"])
def test_order_measured_through_the_nonlinear_program(control, swing):
    """With start, duration and torque held fixed the defects are an integrator, and have its order."""
    robot, exact = swing
    scheme, dynamics = Scheme(control), Dynamics(robot, free_last_body=True)
    scales = (exact.duration, 1.0, 10.0, np.zeros(2), np.array([3.0, 3.0]), dynamics.last_body)

    def error(intervals):
        nlp, layout = build_nlp(dynamics, scheme, intervals), Layout(dynamics.nv, scheme)
        by = Parameters(np.full(intervals, 1 / intervals), *scales)
        p, (x,) = by.packed(), to_unknowns(Guesses.of(exact), layout, by)
        free = np.ones(x.size, dtype=bool)
        free[layout.knots(intervals)[0]] = False  # the state and the duration at the start
        free[layout.torques(intervals)] = False
        for _ in range(20):
            g, jacobian = nlp.jacobian(x, p)
            step = spsolve(jacobian.sparse()[:, free], np.array(g).ravel())
            x[free] -= step
            if np.max(np.abs(step)) < 1e-12:  # the next one is at rounding: Newton's method is quadratic
                break
        q, v = x[layout.states(intervals)[-1]].reshape(2, -1)
        end = np.concatenate([by.length * q, by.speed * v])
        return np.max(np.abs(end - [*exact.q[-1], *exact.v[-1]]))

    # Asymptotic, and above the 1e-11 to which the motion itself is known.
    n = np.array([24, 32, 48])
    slope = np.polyfit(np.log(n), np.log([error(k) for k in n]), 1)[0]
    assert -slope == pytest.approx(4, rel=0.1)
