"""Excesses over limits, in closed form."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import armdyn as ad
from armdyn.optimal.verify.limit_violations import excesses, limit_violation, worst_violation
from armdyn.optimal.verify.slowing import paced, paced_torques
from oracles import PinDynamics, assert_close, random_states
from problems import paper_arm, paper_problem


def test_limit_violation_looks_between_samples():
    problem = paper_problem("r", velocity_limit=1.0)
    # Between two samples at 0.9 rad/s the cubic speeds up to 1.5 times the mean slope less a quarter.
    motion = ad.Trajectory([0, 1], [[0.0], [1.2]], [[0.9], [0.9]], [[0.0], [0.0]])
    fastest = 1.5 * 1.2 - 0.5 * 0.9
    assert limit_violation(problem.limits, motion) == pytest.approx(fastest - 1.0, rel=1e-9)


def test_the_worst_limit_is_named_with_joint_and_time():
    problem = paper_problem("rr", velocity_limit=[1.0, 2.0])
    t = [0.0, 1.0, 2.0]
    q, tau = np.zeros((3, 2)), np.array([[0.0, 0.0], [0.0, 4.5], [0.0, 0.0]])
    motion = ad.Trajectory(t, q, np.array([[0.0, 0.0], [1.2, 0.0], [0.0, 0.0]]), tau)
    worst = worst_violation(problem.robot, problem.limits, motion)
    assert (worst.constraint, worst.joint, worst.time) == ("torque limit", "joint2", 1.0)
    assert worst.value == pytest.approx(0.5)  # 1.5 of 3 N m
    assert excesses(problem.limits, motion, dense=1)[1].share == pytest.approx(0.2)
    fast = excesses(problem.limits, motion, dense=1)[1].worst(problem.robot)
    assert str(fast) == "velocity limit of joint 'joint1' at t = 1 s by 0.2 rad/s"


def test_a_motion_within_its_limits_exceeds_none():
    problem = paper_problem("rr")
    still = ad.Trajectory([0, 1], np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)))
    assert limit_violation(problem.limits, still) == 0.0
    assert worst_violation(problem.robot, problem.limits, still) is None


FACTORS = st.floats(0.5, 2.0)


def at_random(nv, count=4):
    """Positions, velocities and accelerations, each of shape (count, nv)."""
    return (np.array(part) for part in zip(*random_states(nv, count), strict=True))


@pytest.mark.parametrize("arm", ["r", "rr", "rrr"])
@settings(max_examples=20)
@given(factor=FACTORS)
def test_torques_are_those_of_velocities_over_s_and_accelerations_over_s_squared(arm, factor):
    robot = paper_arm(arm)
    pin = PinDynamics(robot)
    q, v, a = at_random(robot.nv)
    zero = np.zeros_like(v)
    tau = np.array([pin.rnea(*row) for row in zip(q, v, a, strict=True)])
    found = paced_torques(robot, ad.trajectory.Sample(q, v, zero), tau, factor)
    assert_close(found, [pin.rnea(*x) for x in zip(q, v / factor, a / factor**2, strict=True)], 1e-10)
    # Hollerbach's law: all of a torque but gravity's goes with 1/s².
    gravity = np.array([pin.gravity(row) for row in q])
    assert_close(found - gravity, (tau - gravity) / factor**2, 1e-10)


def test_at_its_own_pace_friction_is_paid_all_the_same():
    robot = paper_arm("rr").with_friction(0.1, 0.2, 0.05)
    q, v, a = at_random(2)
    pin = PinDynamics(robot)
    bare = np.array([pin.rnea(*row) for row in zip(q, v, a, strict=True)])
    tau = bare + robot.friction.torque(v)
    at = ad.trajectory.Sample(q, v, tau)
    assert_close(paced_torques(robot, at, tau, 1.0), tau, 1e-10)
    slow = [pin.rnea(*x) for x in zip(q, v / 2, a / 4, strict=True)] + robot.friction.torque(v / 2)
    assert_close(paced_torques(robot, at, tau, 2.0), slow, 1e-10)


@given(FACTORS)
def test_a_paced_motion_has_the_same_path(factor):
    t = np.array([0.0, 0.3, np.nextafter(0.3, 1), 0.7, 1.0])
    q = np.array([[0.0], [0.2], [0.2], [0.5], [1.0]])
    motion = ad.Trajectory(t, q, np.ones((5, 1)), np.array([[1.0], [1], [-1], [-1], [0]]))
    slow = paced(motion, factor)
    assert slow.duration == pytest.approx(factor, rel=1e-15)
    assert np.array_equal(slow.q, q) and np.array_equal(slow.tau, motion.tau)
    at = np.linspace(0, 1, 23)
    # Positions are a cubic of time over duration, for any duration.
    np.testing.assert_allclose(slow(factor * at).q, motion(at).q, atol=1e-12)
    np.testing.assert_allclose(factor * slow(factor * at).v, motion(at).v, atol=1e-11)
