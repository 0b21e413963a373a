"""Options of a user, and refused values; the tableaus of the programs' collocation and of the replay."""

from dataclasses import fields

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp
from scipy.sparse.linalg import spsolve
from scipy.special import roots_legendre

import armdyn as ad
from armdyn.dynamics import Dynamics
from armdyn.errors import ProblemError
from armdyn.optimal.mesh.assembly import build_nlp
from armdyn.optimal.mesh.unknowns import Scales, to_unknowns
from armdyn.optimal.problem.options import GAUSS_3, LOBATTO_3, Scheme
from armdyn.trajectory import Trajectory
from problems import paper_arm


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"max_intervals": 0}, "max_intervals is 0"),
        ({"workers": 0}, "workers is 0"),
        ({"starts": -1}, "starts is -1"),
        ({"time_limit": -1.0}, "time_limit is -1.0; it must be positive"),
        ({"calm": float("nan")}, "calm"),
    ],
)
def test_bad_options(option, message):
    with pytest.raises(ProblemError, match=message):
        ad.MinimumTimeOptions(**option)


def test_every_option_is_documented():
    text = ad.MinimumTimeOptions.__doc__
    assert all(f"{field.name}:" in text for field in fields(ad.MinimumTimeOptions))


EVERY = pytest.mark.parametrize(("tableau", "order"), [(LOBATTO_3, 4), (GAUSS_3, 6)], ids=["lobatto", "gauss"])


@EVERY
def test_order_measured_on_a_nonlinear_equation(tableau, order):
    # x' = x cos t, x = exp(sin t): one Newton-free linear solve per interval, as f is linear in x.
    def error(n):
        h, x = 2.0 / n, 1.0
        for k in range(n):
            rate = np.cos(k * h + tableau.c * h)
            stages = np.linalg.solve(np.eye(tableau.c.size) - h * tableau.A * rate, np.full(tableau.c.size, x))
            x += h * tableau.b @ (rate * stages)
        return abs(x - np.exp(np.sin(2.0)))

    n = np.array([8, 16, 32])
    slope = np.polyfit(np.log(n), np.log([error(k) for k in n]), 1)[0]
    # A regression over two halvings is off the asymptotic order by a few per cent.
    assert -slope == pytest.approx(order, rel=0.05)


def test_nodes_are_scipys():
    # Half a unit in the last place of numbers below one.
    np.testing.assert_allclose(GAUSS_3.c, (1 + roots_legendre(3)[0]) / 2, rtol=0, atol=1e-16)


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
    scales = Scales(exact.duration, 1.0, 10.0, np.array([3.0, 3.0]))

    def error(intervals):
        nlp = build_nlp(dynamics, scheme, intervals)
        fractions = np.full(intervals, 1 / intervals)
        p = scales.parameters(fractions, scales.weights(0.0), dynamics.last_body)
        x = to_unknowns(exact, nlp.layout, fractions, scales)
        free = np.ones(x.size, dtype=bool)
        free[nlp.layout.knots(intervals)[0]] = False  # the state and the duration at the start
        held = nlp.layout.knots(intervals)[:, nlp.layout.knot.torque]
        free[held if nlp.layout.linear else nlp.layout.torques(intervals)] = False
        for _ in range(20):
            g, jacobian = nlp.jacobian(x, p)
            step = spsolve(jacobian.sparse()[:, free], np.array(g).ravel())
            x[free] -= step
            if np.max(np.abs(step)) < 1e-12:  # the next one is at rounding: Newton's method is quadratic
                break
        q, v = x[nlp.layout.states(intervals)[-1]].reshape(2, -1)
        end = np.concatenate([scales.length * q, scales.speed * v])
        return np.max(np.abs(end - [*exact.q[-1], *exact.v[-1]]))

    # Asymptotic, and above the 1e-11 to which the motion itself is known.
    n = np.array([24, 32, 48])
    slope = np.polyfit(np.log(n), np.log([error(k) for k in n]), 1)[0]
    assert -slope == pytest.approx(4, rel=0.1)


@EVERY
def test_polynomials_are_integrated_exactly(tableau, order):
    """Hairer, Wanner: Solving ODEs II, section IV.5: C(s), which makes it collocation, and B(order)."""
    c = tableau.c[:, None]
    assert np.all(np.diff(tableau.c) > 0)
    power = np.arange(1, c.size + 1)
    np.testing.assert_allclose(tableau.A @ c ** (power - 1), c**power / power, atol=1e-14)
    power = np.arange(1, order + 1)
    np.testing.assert_allclose(tableau.b @ c ** (power - 1), 1 / power, atol=1e-14)


def test_stages_that_are_knots():
    # Lobatto begins and ends at a knot: the program's equations rely on it.
    np.testing.assert_array_equal(LOBATTO_3.c, [0.0, 0.5, 1.0])
    assert not np.any(LOBATTO_3.A[0]) and np.array_equal(LOBATTO_3.A[-1], LOBATTO_3.b)
