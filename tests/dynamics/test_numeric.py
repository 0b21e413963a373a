import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.dynamics import Dynamics, forward_dynamics, inverse_dynamics
from armdyn.dynamics.numeric import forward_dynamics_derivatives, inverse_dynamics_derivatives, joint_inertia
from armdyn.errors import BridgeError
from armdyn.models.robots.tree import Tree
from oracles import assert_close, random_states, robot_named
from problems import cart

TOLERANCE = 1e-10
"""Promised accuracy of `Dynamics` against `pin.aba`."""


def rubbing(name):
    """A robot with friction, and that friction written out."""
    bare = robot_named(name)
    d, f, width = (np.linspace(*ends, bare.nv) for ends in ((0.5, 1.5), (2.0, 0.0), (0.02, 0.1)))
    return bare.with_friction(d, f, width), lambda v: d * v + f * np.tanh(v / width)


@pytest.mark.parametrize("name", ["rr", "ur5", "kinova"])
def test_friction_is_a_torque_that_is_lost(name):
    robot, lost = rubbing(name)
    model, data = robot.model, robot.model.createData()
    dynamics, forward, inverse = Dynamics(robot), forward_dynamics(robot), inverse_dynamics(robot)
    for q, v, u in random_states(robot.nv):
        a = pin.aba(model, data, robot.configuration(q), v, u - lost(v))
        assert_close(forward(q, v, u), a, TOLERANCE)
        assert_close(dynamics.aba(q, v, u), a, TOLERANCE)
        tau = pin.rnea(model, data, robot.configuration(q), v, u) + lost(v)
        assert_close(inverse(q, v, u), tau, TOLERANCE)
        assert_close(dynamics.rnea(q, v, u), tau, TOLERANCE)
        assert_close(dynamics.crba(q) @ u + dynamics.nle(q, v), tau, TOLERANCE)
        assert_close(inverse(q, v, forward(q, v, u)), u, TOLERANCE)


@pytest.mark.parametrize("name", ["rr", "kinova", "cart"])
def test_many_states_at_once_are_pins(name):
    robot = cart() if name == "cart" else robot_named(name)
    model, data, n = robot.model, robot.model.createData(), robot.nv
    q, v, u = (np.array(each) for each in zip(*random_states(n, count=6), strict=True))
    a, by_q, by_v, by_u = forward_dynamics_derivatives(robot)(q, v, u)
    tau, inertia = inverse_dynamics(robot)(q, v, u), joint_inertia(robot)(q.reshape(2, 3, n))
    assert inertia.shape == (2, 3, n, n)
    assert_close(forward_dynamics(robot)(q.reshape(2, 3, n), v, u.reshape(2, 3, n)).reshape(6, n), a, TOLERANCE)
    for k in range(6):
        state = robot.configuration(q[k]), v[k], u[k]
        assert_close(a[k], pin.aba(model, data, *state), TOLERANCE)
        assert_close(tau[k], pin.rnea(model, data, *state), TOLERANCE)
        upper = np.triu(np.array(pin.crba(model, data, state[0])))
        assert_close(inertia.reshape(6, n, n)[k], upper + np.triu(upper, 1).T, TOLERANCE)
        pin.computeABADerivatives(model, data, *state)
        assert_close(by_q[k], data.ddq_dq, TOLERANCE)
        assert_close(by_v[k], data.ddq_dv, TOLERANCE)
        assert_close(np.triu(by_u[k]), np.triu(data.Minv), TOLERANCE)
        assert_close(by_u[k], by_u[k].T, 0.0)


def test_derivatives_know_friction():
    robot, _ = rubbing("rr")
    forward, step = forward_dynamics(robot), 1e-6
    q, v, u = next(random_states(2))
    _, _, by_v, _ = forward_dynamics_derivatives(robot)(q, v, u)
    for column, own in enumerate(step * np.eye(2)):
        assert_close(by_v[:, column], (forward(q, v + own, u) - forward(q, v - own, u)) / (2 * step), 1e-6)


@pytest.mark.parametrize("name", ["rr", "kinova"])
def test_derivatives_of_the_torque_are_those_of_the_acceleration(name):
    robot, _ = rubbing(name)
    q, v, u = (np.array(each) for each in zip(*random_states(robot.nv, count=6), strict=True))
    tau, by_q, by_v, inertia = inverse_dynamics_derivatives(robot)(q, v, u)
    a, a_by_q, a_by_v, inverse = forward_dynamics_derivatives(robot)(q, v, tau)
    one = np.broadcast_to(np.eye(robot.nv), inertia.shape)
    # Light wrists lose digits in the inverse.
    for found, expected in ((a, u), (by_q, -inertia @ a_by_q), (by_v, -inertia @ a_by_v), (inertia @ inverse, one)):
        assert_close(found, expected, 1e-8)


def test_an_arm_that_is_not_pins_is_refused(monkeypatch):
    other = Tree.of(robot_named("rr").with_payload(ad.Payload(mass=0.1)).model)
    monkeypatch.setattr(Tree, "of", lambda *_: other)
    with pytest.raises(BridgeError, match=r"differ by .* in the motion of"):
        forward_dynamics(robot_named("rr").with_payload(ad.Payload(mass=0.2)))  # one that is not known yet


def test_results_are_the_callers_own():
    robot, _ = rubbing("rr")
    forward = forward_dynamics(robot)
    states = list(random_states(2, count=2))
    first = forward(*states[0])
    kept = first.copy()
    forward(*states[1])
    assert np.array_equal(first, kept)


def test_friction_with_a_payload_or_body_that_is_an_argument():
    robot, _ = rubbing("rr")
    q, v, u = next(random_states(2))
    expected = Dynamics(robot).aba(q, v, u)
    free = Dynamics(robot, free_last_body=True)
    assert_close(free.aba(q, v, u, free.last_body), expected, TOLERANCE)
    assert_close(Dynamics(robot, payload_frame="tip").aba(q, v, u, np.zeros(10)), expected, TOLERANCE)


def test_friction_has_derivatives():
    robot, _ = rubbing("rr")
    dynamics = Dynamics(robot)
    v = ca.SX.sym("v", 2)
    slope = ca.Function("slope", [v], [ca.jacobian(dynamics.rnea(np.zeros(2), v, np.zeros(2)), v)])
    # At rest the Coriolis torque is flat.
    assert_close(slope(0).full(), np.diag(robot.friction.slope(np.zeros(2))), TOLERANCE)


def test_only_equal_friction_shares_functions_and_digest():
    bare = robot_named("rr")
    one, other = (Dynamics(bare.with_friction(1.0, 2.0)) for _ in range(2))
    assert one.functions is other.functions
    assert one == other
    assert Dynamics(bare.with_friction(0.0, 0.0)).functions is Dynamics(bare).functions
    kinds = [(1.0, 2.0, 0.01), (1.0, 2.0, 0.02), (2.0, 1.0, 0.01), (1.0, 0.0, 0.01), (0.0, 0.0, 0.01)]
    kinds.append((1.0, 2.0, [0.01, 0.02]))
    assert len({Dynamics(bare.with_friction(*kind)).digest() for kind in kinds}) == len(kinds)
    assert Dynamics(bare.with_friction(0.0, 0.0)).digest() == Dynamics(bare).digest()
