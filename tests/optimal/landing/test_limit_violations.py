"""Excesses over limits, in closed form."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.landing.limit_violations import excesses, limit_violation, worst_violation
from problems import paper_problem


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
    worst = worst_violation(problem.limits, motion, problem.robot.joint_names)
    assert (worst.constraint, worst.joint, worst.time) == ("torque limit", "joint2", 1.0)
    assert worst.value == pytest.approx(0.5)  # 1.5 of 3 N m
    assert excesses(problem.limits, motion, dense=1)[1].share == pytest.approx(0.2)
    assert excesses(problem.limits, motion, dense=1)[1].worst(("a", "b")).joint == "a"


def test_a_motion_within_its_limits_exceeds_none():
    problem = paper_problem("rr")
    still = ad.Trajectory([0, 1], np.zeros((2, 2)), np.zeros((2, 2)), np.zeros((2, 2)))
    assert limit_violation(problem.limits, still) == 0.0
    assert worst_violation(problem.limits, still, problem.robot.joint_names) is None
