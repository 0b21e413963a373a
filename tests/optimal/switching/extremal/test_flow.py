"""The flow of an arm: against another integrator, differences, and an arm that has one joint fewer."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import armdyn as ad
from armdyn.optimal.switching.extremal.flow import STEPS, A, B, flow_of
from problems import paper_arm

TORQUE = {"r": [3.0], "rr": [3.0, -3.0], "rrr": [3.0, -3.0, 3.0]}


def rolled_out(arm, duration, x=None, held=None, torques=None):
    """The steps of one arc, and their derivatives."""
    robot = paper_arm(arm)
    n = robot.nv
    dynamics = ad.Dynamics(robot, free_last_body=True)
    flow = flow_of(dynamics, False)
    x = np.zeros(2 * n) if x is None else np.asarray(x, float)
    begins = np.eye(1, STEPS).ravel()
    first, last = torques or (TORQUE[arm], TORQUE[arm])
    free_mask = np.zeros(n)
    free_mask[-1] = 1.0

    def columns(each):
        return np.tile(np.asarray(each, float)[:, None], STEPS)

    held = np.zeros(n) if held is None else held
    out = flow.rollout(
        x, np.outer(x, begins), begins, np.full(STEPS, duration / STEPS), columns(first), columns(last),
        columns(free_mask), columns(held), columns(dynamics.last_body),
    )  # fmt: skip
    return robot, dynamics, [np.array(each) for each in out]


def test_the_tableau_meets_the_conditions_of_order():
    # Of trees with one branch and of bushes up to order 8: Hairer, Norsett and Wanner I, section II.2.
    c = A.sum(axis=1)
    for k in range(8):
        assert B @ c**k == pytest.approx(1 / (k + 1), abs=1e-14)
    power = np.ones(B.size)
    for k in range(1, 8):
        power = A @ power
        assert B @ power == pytest.approx(1 / np.prod(np.arange(1.0, k + 2)), abs=1e-14)


@pytest.mark.parametrize("arm", ["r", "rr", "rrr"])
def test_it_equals_another_integrator(arm):
    robot, dynamics, (end, *_) = rolled_out(arm, 0.05)
    n = robot.nv

    def rate(t, x):
        return np.r_[x[n:], dynamics.aba(x[:n], x[n:], TORQUE[arm], dynamics.last_body)]

    other = solve_ivp(rate, (0, 0.05), np.zeros(2 * n), "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(end[:, -1], other, rtol=1e-10, atol=1e-10)  # the other's tolerance, over some steps


def test_sensitivities_agree_with_differences():
    x, small, duration = np.array([0.3, -0.5, 1.0, 2.0]), 1e-6, 0.02
    _, _, (end, slopes, torque_sensitivities, rates) = rolled_out("rr", duration, x)
    state_transition = np.eye(4)
    for k in range(STEPS):
        state_transition = slopes[:, 4 * k : 4 * k + 4] @ state_transition
    for j, by in enumerate(np.eye(4) * small):
        there = rolled_out("rr", duration, x + by)[2][0][:, -1]
        np.testing.assert_allclose((there - end[:, -1]) / small, state_transition[:, j], rtol=1e-4, atol=1e-4)
    # A torque that is `small` higher at the end of every step: of one step alone it is the answer's second column.
    there = rolled_out("rr", duration, x, torques=([3.0, -3.0], [3.0, -3.0 + small]))[2][0]
    np.testing.assert_allclose((there[:, 0] - end[:, 0]) / small, torque_sensitivities[:, 1], rtol=1e-3, atol=1e-9)
    longer = rolled_out("rr", duration * (1 + small), x)[2][0][:, -1]
    np.testing.assert_allclose((longer - end[:, -1]) / (duration * small), rates[:, -1], rtol=1e-4)


def test_a_joint_that_is_held_keeps_its_velocity_and_the_others_move_as_if_it_were_none():
    # With its elbow held straight the two-link arm is one link.
    robot, dynamics, (end, *_) = rolled_out("rr", 0.1, held=[0.0, 1.0])

    def rate(t, x):
        inertia, bias = dynamics.crba(np.r_[x[0], 0.0], dynamics.last_body)[0, 0], 0.0
        bias = dynamics.nle(np.r_[x[0], 0.0], np.r_[x[1], 0.0], dynamics.last_body)[0]
        return [x[1], (3.0 - bias) / inertia]

    one = solve_ivp(rate, (0, 0.1), [0.0, 0.0], "DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(end[[0, 2], -1], one, rtol=1e-10)
    np.testing.assert_array_equal(end[[1, 3], -1], 0.0)
    assert robot.nv == 2
