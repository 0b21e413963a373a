"""Landing of a mesh's torques where arcs are not resolved."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.landing.aim import aimed
from armdyn.optimal.search.starts import spline
from armdyn.optimal.solve.direct import solve_on_mesh
from armdyn.optimal.task.task import Task
from problems import both_sides, cart, miss, paper_problem


def on_mesh(problem, intervals):
    task = Task.of(problem)
    found = solve_on_mesh(task, spline(problem, []), intervals, task.alone())
    return found.trajectory, *aimed(task, found.trajectory)


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


def test_what_is_far_off_or_not_constant_is_left_alone():
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    t, zero = np.linspace(0, 3, 4), np.zeros((4, 1))
    for torque in (zero, t[:, None]):
        given = ad.Trajectory(t, zero, zero, torque, problem.robot.joint_names)
        motion, replay = aimed(Task.of(problem), given)
        assert motion is given
        assert np.array_equal(replay.q, ad.replay_torques(problem.robot, given).q)


def test_lands_exactly_where_the_answer_is_known():
    """A cart's torques that are a little weak: the double integrator's way is linear in the force."""
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    t = np.linspace(0, 3, 31)
    force = np.where(t < 1.5, 1, -1) * 2.0 / 1.5**2 * 0.99
    middle = np.repeat(force[:-1], 2)[:, None]
    given = ad.Trajectory(both_sides(t), np.zeros((60, 1)), np.zeros((60, 1)), middle, problem.robot.joint_names)
    motion, replay = aimed(Task.of(problem), given)
    assert replay.q[-1, 0] == pytest.approx(2.0, abs=1e-9)
    assert np.abs(motion.tau).max() <= 1.0
