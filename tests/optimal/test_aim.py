"""Landing of a mesh's torques, on arms of more joints than arcs are resolved for."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.optimal.landing.aim import aimed, led_home
from armdyn.optimal.problem.stop import stopping
from armdyn.optimal.search.starts import spline
from armdyn.optimal.solve.direct import solve_on_mesh
from armdyn.optimal.task.task import Task
from problems import cart, paper_problem


def on_mesh(problem, intervals):
    with stopping(60) as stop:
        task = Task.of(problem, stop=stop)
        found = solve_on_mesh(task, spline(problem, []), intervals, task.options.alone())
        return found.trajectory, *aimed(problem, found.trajectory, stop)


def miss(problem, replay):
    return np.abs(np.concatenate([replay.q[-1], replay.v[-1]]) - problem.x_goal).max()


@pytest.mark.parametrize("friction", [0.0, 0.05])
def test_torques_change_a_little_and_land(friction):
    bare = paper_problem("rr", velocity_limit=15.0)
    robot = bare.robot.with_friction(friction, friction)
    problem = ad.MinimumTimeProblem(robot, q_start=bare.q_start, q_goal=bare.q_goal, velocity_limit=15.0)
    found, motion, replay = on_mesh(problem, 40)
    before = miss(problem, ad.replay_torques(robot, found))
    assert before > 1e-6
    # What it aims for, in rad; 1e-6 rad/s is 1e-7 of the speeds.
    assert np.abs(replay.q[-1] - problem.q_goal).max() < 1e-8
    assert miss(problem, replay) < 1e-6
    assert miss(problem, ad.replay_torques(robot, motion)) < 1e-6
    assert np.all(np.abs(motion.tau) <= problem.limits.effort_upper)
    # The change is about as large as the miss, not as the motion.
    assert motion.duration == pytest.approx(found.duration, rel=10 * before)


def test_what_is_far_off_or_not_constant_is_left_alone(tmp_path):
    problem = ad.MinimumTimeProblem(cart(tmp_path), q_start=[0.0], q_goal=[2.0])
    t, zero = np.linspace(0, 3, 4), np.zeros((4, 1))
    with stopping(60) as stop:
        for torque in (zero, t[:, None]):
            given = ad.Trajectory(t, zero, zero, torque, problem.robot.joint_names)
            motion, replay = aimed(problem, given, stop)
            assert motion is given
            assert np.array_equal(replay.q, ad.replay_torques(problem.robot, given).q)


def test_lands_exactly_where_the_answer_is_known(tmp_path):
    """A cart's torques that are a little weak: the double integrator's way is linear in the force."""
    problem = ad.MinimumTimeProblem(cart(tmp_path), q_start=[0.0], q_goal=[2.0])
    t = np.linspace(0, 3, 31)
    force = np.where(t < 1.5, 1, -1) * 2.0 / 1.5**2 * 0.99
    with stopping(60) as stop:
        middle, steps = np.repeat(force[:-1], 2)[:, None], np.repeat(t, 2)[1:-1]
        steps[1:-1:2] = np.nextafter(steps[1:-1:2], 0)
        given = ad.Trajectory(steps, np.zeros((60, 1)), np.zeros((60, 1)), middle, problem.robot.joint_names)
        motion, replay = aimed(problem, given, stop)
    assert replay.q[-1, 0] == pytest.approx(2.0, abs=1e-9)
    assert np.abs(motion.tau).max() <= 1.0


@pytest.mark.parametrize("limit", [np.inf, 1.08])
def test_feedback_leads_home_what_falls_over(limit):
    """Two links pass the upright slowly: open loop the error of 40 constant torques grows like e^(13 t)."""
    q0, q1, duration, pieces = np.array([np.pi / 2 - 0.3, 0.2]), np.array([np.pi / 2 + 0.3, -0.2]), 1.0, 40
    robot = paper_problem("rr").robot
    problem = ad.MinimumTimeProblem(robot, q_start=q0, q_goal=q1, velocity_limit=limit)
    t = np.repeat(np.linspace(0, duration, pieces + 1), 2)[1:-1]
    t[1:-1:2] = np.nextafter(t[1:-1:2], 0)
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
    with stopping(60) as stop:
        motion, replay, left = led_home(problem, mesh, stop)
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
    with stopping(60) as stop:
        assert led_home(problem, ad.Trajectory(t, zero, zero, t[:, None] * [1, 1], ("a", "b")), stop)[2] == np.inf
