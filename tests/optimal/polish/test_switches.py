"""Switches of bang arcs: read off a mesh, in order, and those that meet."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.optimal.polish.polish import Switches, switches_of
from problems import cart, gantry_problem


def test_arcs_between_the_switches_of_two_joints():
    switches = Switches.ordered(np.array([1.0, -1.0]), [np.array([0.2, 0.6]), np.array([0.5])], 1.0)
    np.testing.assert_array_equal(switches.signs, [[1, -1], [-1, -1], [-1, 1], [1, 1]])
    np.testing.assert_allclose(switches.lengths, [0.2, 0.3, 0.1, 0.4], atol=1e-15)
    assert [own.tolist() for own in switches.by_joint] == [[0.2, 0.6], [0.5]]


@pytest.mark.parametrize(
    ("times", "first", "left"),
    [
        ([0.3, 0.3], 1.0, []),  # they meet
        ([0.2, 0.5, 0.4], 1.0, [0.2]),  # the last two cross
        ([-0.1, 0.4], -1.0, [0.4]),  # one passes the start, and the torque begins on the other limit
        ([0.4, 1.2], 1.0, [0.4]),  # one passes the end
    ],
)
def test_switches_that_meet_or_pass_an_end_vanish(times, first, left):
    switches = Switches.ordered(np.array([1.0]), [np.array(times)], 1.0)
    assert switches.first.tolist() == [first]
    assert switches.times.tolist() == left


@given(st.lists(st.floats(0.01, 0.99), max_size=6, unique=True))
def test_the_sign_changes_at_every_switch(times):
    switches = Switches.ordered(np.array([-1.0]), [np.array(sorted(times))], 1.0)
    assert switches.times.tolist() == sorted(times)
    np.testing.assert_array_equal(switches.signs[:, 0], [-((-1.0) ** k) for k in range(len(times) + 1)])


@given(st.floats(0.05, 0.95))
def test_a_switch_within_an_interval_is_where_its_mean_torque_says(time):
    # Ten intervals of a second in all; the torque of the one with the switch is the mean.
    knots = np.linspace(0, 1, 11)
    tau = np.interp(knots[1:], [0, time, 1], [0, time, 2 * time - 1])
    tau = np.diff(np.append(0.0, tau)) / np.diff(knots)
    t = np.sort(np.concatenate([knots, np.nextafter(knots[1:-1], 0)]))
    held = np.repeat(tau, 2)[:, None]
    still = np.zeros_like(held)
    switches = switches_of(ad.Trajectory(t, still, still, held, cart().joint_names, "mesh"), _limits(), 1e-3)
    np.testing.assert_allclose(switches.times, [time], atol=1e-12)


@pytest.mark.parametrize(("k", "first", "times"), [(0, -1.0, [0.02]), (4, 1.0, [0.44, 0.46]), (9, 1.0, [0.98])])
def test_a_brief_change_within_one_interval_is_seen(k, first, times):
    # On the lower limit for a fifth of one of ten intervals: at the start, in the middle, at the end.
    tau = np.ones((10, 1))
    tau[k] = 0.6
    t, held = np.linspace(0, 1, 11), np.vstack([tau, tau[-1:]])
    motion = ad.Trajectory(t, 0 * held, 0 * held, held, cart().joint_names, "mesh", hold="zero-order")
    switches = switches_of(motion, _limits(), 0.02)
    assert switches.first.tolist() == [first]
    np.testing.assert_allclose(switches.times, times, atol=1e-12)


def _limits():
    """Of one joint, from -1 to 1 N."""
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[1.0], effort_limit=1.0)
    return problem.limits.actuators


def test_a_joint_without_a_motor_has_no_switches():
    problem = gantry_problem(effort_limit=[1.0, 0.0])
    t, states = np.array([0.0, 0.5, 1.0]), np.zeros((3, 2))
    tau = np.array([[1.0, 0.0], [-1.0, 0.0], [-1.0, 0.0]])
    motion = ad.Trajectory(t, states, states, tau, problem.robot.joint_names, "mesh", hold="zero-order")
    assert switches_of(motion, problem.limits.actuators).joint.tolist() == [0]
