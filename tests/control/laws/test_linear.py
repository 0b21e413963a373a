import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

import armdyn as ad
from armdyn.control.laws.linear import Steps, best_gains, linearised, loop_steps, plant_steps
from armdyn.control.loop.references import Ticks
from armdyn.dynamics import forward_dynamics
from oracles import random_states, robot_named
from plain_loop import stepped
from problems import GANTRY, paper_arm

ROBOTS = {
    "rrr": paper_arm("rrr"),
    "rubbing": paper_arm("rr").with_friction(0.01, 0.06, 0.05),
    "gantry": ad.Robot.from_urdf_string(GANTRY),
    "kinova": robot_named("kinova"),  # continuous joints, which Pinocchio stores as cosine and sine
}


def stencil(function, at, step=1e-3):
    """Five points: its truncation, ~h⁴/30 of the fifth derivative, is as small as its rounding, ~1e-16/h."""
    columns = []
    for d in step * np.eye(at.size):
        near, far = (function(at + k * d) - function(at - k * d) for k in (1, 2))
        columns.append((8 * near - far) / (12 * step))
    return np.column_stack(columns)


@pytest.mark.parametrize("name", ROBOTS)
def test_slopes_are_those_of_differences(name):
    robot = ROBOTS[name]
    nv, aba = robot.nv, forward_dynamics(robot)
    for q, v, tau in random_states(nv, count=3):
        A, B = linearised(robot, q, v / 10 if robot.friction.present else v, tau)
        v = v / 10 if robot.friction.present else v
        x = np.concatenate([q, v])
        expected = stencil(lambda x, tau=tau: aba(x[:nv], x[nv:], tau), x, 2e-4)
        scale = np.abs(expected).max()
        assert np.abs(A[nv:] - expected).max() < 1e-7 * max(scale, 1)  # of the stencil, whose bends are of tanh's width
        assert np.array_equal(A[:nv], np.hstack([np.zeros((nv, nv)), np.eye(nv)]))
        torques = stencil(lambda tau, q=q, v=v: aba(q, v, tau), tau)
        assert np.abs(B[nv:] - torques).max() < 1e-9 * np.abs(torques).max()
        assert not B[:nv].any()


def error_of_a_step(robot, rate):
    """Largest error of A and B in the middle of a ramp, as parts of the change in a tick."""
    motion = ad.ramp(robot, [-1.0, 0.5, 0.1], [0.3, -0.2, 0.5], 0.2)
    ticks = Ticks.of(robot, motion, rate)
    steps, aba, h, nv = plant_steps(robot, ticks), forward_dynamics(robot), 1 / rate, robot.nv
    k = int(0.07 * rate)
    start = np.concatenate([ticks.q[k], ticks.v[k]])

    def after(x, tau):
        return np.concatenate(stepped(aba, x[:nv], x[nv:], tau, h, 20))

    A = stencil(lambda x: after(x, ticks.tau[k]), start, 1e-4)
    B = stencil(lambda tau: after(start, tau), ticks.tau[k], 1e-2)
    return np.abs(steps.A[k] - A).max(), np.abs(steps.B[k] - B).max() / np.abs(B).max()


def test_steps_are_those_of_the_arm_to_third_order():
    rates = np.array([200.0, 400.0, 800.0])
    errors = np.array([error_of_a_step(ROBOTS["rrr"], rate) for rate in rates])
    order = -np.log2(errors[1:] / errors[:-1])
    assert np.all(order[:, 0] > 2.7)  # the midpoint rule's third order per step
    assert np.all(order[:, 1] > 1.7)  # B itself is of first order
    assert np.all(error_of_a_step(ROBOTS["rrr"], 1000.0) < np.array([1e-4, 1e-3]))


def test_the_last_step_is_at_rest_at_the_goal():
    robot = ROBOTS["rrr"]
    goal = [0.3, -0.2, 0.5]
    moving = plant_steps(robot, Ticks.of(robot, ad.ramp(robot, [0, 0, 0], goal, 0.1), 1000.0))
    still = plant_steps(robot, Ticks.of(robot, ad.set_point(robot, goal), 1000.0))
    assert moving.A[-1] == pytest.approx(still.A[0], abs=1e-12)
    assert moving.B[-1] == pytest.approx(still.B[-1], abs=1e-12)


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_a_loop_remembers_integrals_and_torques(delay):
    random = np.random.default_rng(0)
    nv, h, count = 2, 0.01, 12
    plant = Steps(random.normal(size=(count, 4, 4)) / 3, random.normal(size=(count, 4, 2)))
    gathered = np.where(np.arange(count) < 5, 0.0, h)  # the integrals begin late
    steps = loop_steps(plant, delay, gathered)
    x = np.concatenate([random.normal(size=4), np.zeros(2), random.normal(size=delay * nv)])
    state, integral, queue = x[:4], np.zeros(2), [*x[6:].reshape(delay, nv)]
    for k in range(count):
        u = random.normal(size=nv)
        queue.append(u)
        felt = queue.pop(0)
        state, integral = plant.A[k] @ state + plant.B[k] @ felt, integral + gathered[k] * state[:2]
        x = steps.A[k] @ x + steps.B[k] @ u
        assert x == pytest.approx(np.concatenate([state, integral, *queue]), abs=1e-12)


def random_problem(count, m=5, nv=2):
    random = np.random.default_rng(1)
    A = np.eye(m) + random.normal(size=(count, m, m)) / 5
    return Steps(A, random.normal(size=(count, m, nv))), np.diag(random.uniform(0.1, 2.0, m)), np.diag([1.0, 3.0])


def test_a_long_recursion_comes_to_the_algebraic_equations_solution():
    one, Q, R = random_problem(1)
    A, B, P = one.A[0], one.B[0], Q
    for _ in range(2000):  # Riccati's recursion from the weights themselves
        K = np.linalg.solve(R + B.T @ P @ B, B.T @ P @ A)
        P = Q + A.T @ P @ (A - B @ K)
    steps = Steps(np.repeat(one.A, 50, axis=0), np.repeat(one.B, 50, axis=0))
    gains = best_gains(steps, np.tile(np.diag(Q), (50, 1)), np.diag(R))
    assert gains[-1] == pytest.approx(K, rel=1e-9, abs=1e-10)  # both converge to rounding times P's condition
    assert gains[0] == pytest.approx(K, rel=1e-9, abs=1e-10)


def test_no_other_torques_cost_less():
    # The sum over the horizon and the steady cost from there on, as one least-squares problem in all torques.
    count = 6
    steps, Q, R = random_problem(count + 1)
    share = np.append(np.linspace(0.1, 0.6, count), 1.0)
    gains = best_gains(steps, np.outer(share, np.diag(Q)), np.diag(R))
    end = np.linalg.cholesky(solve_discrete_are(steps.A[-1], steps.B[-1], Q, R)).T
    m, nv = steps.B.shape[1:]
    x0 = np.array([1.0, -0.5, 0.2, 0.7, -1.0])
    # x[k] = free[k] + forced[k] u.
    free, forced = [x0], [np.zeros((m, count * nv))]
    for k in range(count):
        push = np.zeros((m, count * nv))
        push[:, k * nv : (k + 1) * nv] = steps.B[k]
        free.append(steps.A[k] @ free[-1])
        forced.append(steps.A[k] @ forced[-1] + push)
    roots = [np.sqrt(s) * np.linalg.cholesky(Q).T for s in share[:count]] + [end]
    rows = np.vstack([*(root @ f for root, f in zip(roots, forced, strict=True)), np.kron(np.eye(count), np.sqrt(R))])
    wanted = np.concatenate([*(-root @ f for root, f in zip(roots, free, strict=True)), np.zeros(count * nv)])
    best = np.linalg.lstsq(rows, wanted, rcond=None)[0].reshape(count, nv)
    x = x0
    for k in range(count):
        assert -gains[k] @ x == pytest.approx(best[k], rel=1e-8, abs=1e-9)  # rounding, times the condition
        x = steps.A[k] @ x + steps.B[k] @ best[k]


def test_an_uncontrollable_arm_is_refused():
    steps = Steps(np.array([np.diag([1.1, 0.5])]), np.array([[[0.0], [1.0]]]))
    with pytest.raises(ad.ArmdynError, match="no linear-quadratic regulator"):
        best_gains(steps, np.ones((1, 2)), np.ones(1))
