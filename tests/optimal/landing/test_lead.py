"""Motions that open loop go astray, led home by feedback."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.optimal.landing.lead import led_home
from armdyn.optimal.task.task import Task
from problems import both_sides, miss, paper_problem


@pytest.mark.parametrize("limit", [np.inf, pytest.param(1.08, marks=pytest.mark.slow)])
def test_feedback_leads_home_what_falls_over(limit):
    """Two links pass the upright slowly: open loop the error of 40 constant torques grows like e^(13 t)."""
    q0, q1, duration, pieces = np.array([np.pi / 2 - 0.3, 0.2]), np.array([np.pi / 2 + 0.3, -0.2]), 1.0, 40
    robot = paper_problem("rr").robot
    problem = ad.MinimumTimeProblem(robot, q_start=q0, q_goal=q1, velocity_limit=limit)
    t = both_sides(np.linspace(0, duration, pieces + 1))
    torque = inverse_dynamics(robot)

    def path(t):
        s = t[:, None] / duration
        rates = (s**3 * (10 + s * (6 * s - 15)), 30 * s**2 * (1 - s) ** 2, 60 * s * (1 - s) * (1 - 2 * s))
        return tuple((q0 if k == 0 else 0) + rate * (q1 - q0) / duration**k for k, rate in enumerate(rates))

    middle = path((np.arange(pieces) + 0.5) * duration / pieces)
    tau = np.repeat([torque(*x) for x in zip(*middle, strict=True)], 2, axis=0)
    q, v, _ = path(t)
    mesh = ad.Trajectory(t, q, v, tau, robot.joint_names)
    assert miss(problem, ad.replay_torques(robot, mesh)) > 0.5
    motion, replay, left = led_home(Task.of(problem), mesh)
    # A round halves the miss or better: twelve make a thousandth rad some 1e-6 at most.
    assert left < 1e-6 and miss(problem, replay) < 1e-6
    assert miss(problem, ad.replay_torques(robot, motion)) < 1e-6
    assert np.all(np.abs(motion.tau) <= problem.limits.effort_upper)
    # The path is as fast as 1.125 rad/s at its middle: it is slowed down only where that is not allowed.
    slowed = max(1.0, 1.125 / limit)
    assert motion.duration == pytest.approx(slowed * duration, rel=5e-3)
    assert np.all(np.abs(replay.v) <= problem.limits.velocity * (1 + 1e-6))


def test_torques_that_are_not_constant_are_not_led():
    problem = paper_problem("rr")
    t, zero = np.linspace(0, 1, 5), np.zeros((5, 2))
    ramps = ad.Trajectory(t, zero, zero, t[:, None] * [1, 1], ("a", "b"))
    assert led_home(Task.of(problem), ramps)[2] == np.inf
