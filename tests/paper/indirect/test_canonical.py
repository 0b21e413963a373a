"""The canonical system against finite differences of H from Pinocchio's own numbers."""

import casadi as ca
import numpy as np
import pytest

from armdyn.paper.indirect.canonical import canonical_system, columns
from armdyn.paper.indirect.law import MINIMUM, TorqueLaw
from oracles import PinDynamics, random_states, robot_named

ARMS = ("r", "rr", "rrr", "double_pendulum", pytest.param("ur5", marks=pytest.mark.slow))
W = 0.7
"""Effort weight [1/(N m)²]."""
OTHER = TorqueLaw("other", lambda symbols: -symbols.rho_v, lambda symbols: ca.SX(1), minimises=False)


def points(robot, count=3):
    """y = (q, v, ρ), shape (4 nv,), and a torque, shape (nv,)."""
    random = np.random.default_rng(1)
    for q, v, tau in random_states(robot.nv, count):
        yield np.concatenate([q, v, random.normal(size=2 * robot.nv)]), tau


def hamiltonian(robot, y, tau, w):
    """H = 1 + w/2 τᵀτ + ρᵀf by `pin.aba`."""
    n = robot.nv
    f = np.concatenate([y[n : 2 * n], PinDynamics(robot).aba(y[:n], y[n : 2 * n], tau)])
    return 1 + w / 2 * tau @ tau + y[2 * n :] @ f


def slope(function, y, step=1e-5):
    """Central differences, shape (..., y.size)."""
    return np.stack([(function(y + step * e) - function(y - step * e)) / (2 * step) for e in np.eye(y.size)], axis=-1)


@pytest.mark.parametrize("name", ARMS)
def test_flow_is_the_symplectic_gradient_of_h(name):
    robot = robot_named(name)
    system, n = canonical_system(robot), robot.nv
    for y, tau in points(robot):
        value = system.hamiltonian(y, tau, W)[0]
        assert float(value) == pytest.approx(hamiltonian(robot, y, tau, W), rel=1e-9)
        by_y = slope(lambda y, tau=tau: hamiltonian(robot, y, tau, W), y)
        flow = system.flow(y, tau).full().ravel()
        # Central differences of step 1e-5: 1e-10 of the third derivative and 1e-11 of H.
        np.testing.assert_allclose(flow, np.concatenate([by_y[2 * n :], -by_y[: 2 * n]]), rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("name", ARMS)
def test_law_minimises_h_within_the_limits(name):
    robot = robot_named(name)
    system, random = canonical_system(robot), np.random.default_rng(2)
    for y, tau in points(robot):
        upper = np.abs(tau) + 0.1
        best = system.torque(y, W, -upper, upper).full().ravel()
        assert np.all(np.abs(best) <= upper)
        least = hamiltonian(robot, y, best, W)
        assert float(system.terminal(y, W, -upper, upper)[0]) == pytest.approx(least, rel=1e-9)
        for other in random.uniform(-upper, upper, (50, robot.nv)):
            assert hamiltonian(robot, y, other, W) >= least - 1e-9 * abs(least)


@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("law", [MINIMUM, OTHER], ids=lambda law: law.name)
def test_derivatives_against_finite_differences(name, law):
    robot = robot_named(name)
    system, n = canonical_system(robot, law), robot.nv
    none = np.full(n, np.inf)
    for y, tau in points(robot, 2):
        # Limits that the law is far from, or far beyond, so that no difference crosses a corner.
        free = system.torque(y, W, -none, none).full().ravel()
        upper = np.where(np.arange(n) % 2, np.abs(free) / 2, np.abs(free) * 2)
        limits = W, -upper, upper
        for derivative, function in (
            (system.rate_jacobian(y, *limits), lambda y, limits=limits: system.rate(y, *limits)),
            (system.terminal(y, *limits)[1], lambda y, limits=limits: system.terminal(y, *limits)[0]),
            (system.flow_jacobian(y, tau)[1], lambda y, tau=tau: system.flow(y, tau)),
            (system.switching(y)[1], lambda y: system.switching(y)[0]),
            (system.hamiltonian(y, tau, W)[1], lambda y, tau=tau: system.hamiltonian(y, tau, W)[0]),
        ):
            exact, numbers = derivative.full(), slope(lambda y, function=function: function(y).full().ravel(), y)
            # Step 1e-5, and third derivatives of arms a thousand times the first.
            np.testing.assert_allclose(exact, numbers, rtol=1e-5, atol=1e-5 * np.max(np.abs(numbers)))


def test_columns_are_those_of_single_calls():
    system = canonical_system(robot_named("rr"))
    y = np.random.default_rng(0).normal(size=(8, 5))
    limits = np.array([W]), np.full(2, -3.0), np.full(2, 3.0)
    (many,) = columns(system.rate_jacobian, y, *limits)
    assert many.shape == (8, 8, 5)
    for k in range(5):
        assert np.array_equal(many[:, :, k], system.rate_jacobian(ca.DM(y[:, k]), *limits).full())


def test_the_same_arm_has_the_same_system():
    assert canonical_system(robot_named("rr")) is canonical_system(robot_named("rr"))
    assert canonical_system(robot_named("rr")) is not canonical_system(robot_named("rr"), OTHER)
