"""Bang arcs read off a mesh."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.optimal.polish.polish import bang_arcs
from problems import cart, gantry_problem


def held(t, tau, joints=("slide",)):
    """A motion at rest with torques held between its samples."""
    tau = np.vstack([tau, tau[-1:]])
    return ad.Trajectory(np.asarray(t), 0 * tau, 0 * tau, tau, joints, "mesh", hold="zero-order")


def test_arcs_between_the_switches_of_two_joints():
    limits = gantry_problem(effort_limit=1.0).limits.actuators
    tau = np.array([[1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
    signs, lengths = bang_arcs(held([0.0, 0.2, 0.5, 0.6, 1.0], tau, ("x", "y")), limits)
    np.testing.assert_array_equal(signs, tau)
    np.testing.assert_allclose(lengths, [0.2, 0.3, 0.1, 0.4], atol=1e-15)


@given(st.lists(st.floats(0.01, 0.99), max_size=6, unique=True))
def test_the_sign_changes_at_every_switch(times):
    tau = -((-1.0) ** np.arange(len(times) + 1))[:, None]
    signs, lengths = bang_arcs(held([0.0, *sorted(times), 1.0], tau), _limits())
    np.testing.assert_array_equal(signs, tau)
    np.testing.assert_allclose(np.cumsum(lengths), [*sorted(times), 1.0], atol=1e-12)


@given(st.floats(0.06, 0.94))  # nearer to an end its interval's mean has the sign of all others: a finer mesh shows it
def test_a_switch_within_an_interval_is_where_its_mean_torque_says(time):
    # Ten intervals of a second in all; the torque of the one with the switch is the mean.
    knots = np.linspace(0, 1, 11)
    tau = np.interp(knots[1:], [0, time, 1], [0, time, 2 * time - 1])
    tau = np.diff(np.append(0.0, tau)) / np.diff(knots)
    _, lengths = bang_arcs(held(knots, tau[:, None]), _limits())
    np.testing.assert_allclose(lengths, [time, 1 - time], atol=1e-12)


def _limits():
    """Of one joint, from -1 to 1 N."""
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[1.0], effort_limit=1.0)
    return problem.limits.actuators


def test_a_joint_without_a_motor_has_no_switches():
    problem = gantry_problem(effort_limit=[1.0, 0.0])
    tau = np.array([[1.0, 0.0], [-1.0, 0.0]])
    signs, _ = bang_arcs(held([0.0, 0.5, 1.0], tau, problem.robot.joint_names), problem.limits.actuators)
    assert signs[:, 0].tolist() == [1.0, -1.0] and signs[0, 1] == signs[1, 1]
