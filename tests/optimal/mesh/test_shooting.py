"""Multiple shooting from a mesh's motion, and its remaining goal error, against the replay."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.mesh.direct import Attempt, solve_on_mesh
from armdyn.optimal.mesh.search import find
from armdyn.optimal.mesh.shooting import Shooting, gaps, landed, replay_on_goal
from armdyn.optimal.mesh.starts import spline
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.rollout import replay_of
from problems import both_sides, cart, miss, paper_problem

PROBLEM = paper_problem("rr")


def found():
    """A task and a solution on a mesh."""
    task = Task.of(PROBLEM, ad.MinimumTimeOptions(starts=4, workers=1))
    return task, find(task).attempts[0]


def test_the_replay_of_a_landed_mesh_ends_on_the_goal_within_the_torque_limits():
    task, attempt = found()
    before = replay_of(task, attempt.trajectory)
    assert np.max(np.abs(PROBLEM.goal_error_of(before))) > 1e-5
    motion = landed(task, attempt)
    replay = replay_of(task, motion.trajectory(PROBLEM.robot.joint_names))
    assert np.max(np.abs(PROBLEM.goal_error_of(replay))) < 1e-7  # two integrators, steps of a 25th of the motion
    assert np.all(PROBLEM.limits.actuators.allows(motion.tau[:, 0], motion.x[:-1, :2], motion.x[:-1, 2:]))
    assert abs(replay.duration / attempt.trajectory.duration - 1) < 1e-2


def test_gaps_are_those_of_an_integration_and_so_are_their_derivatives():
    _, attempt = found()
    motion = Shooting.of(PROBLEM, attempt, 1e-5)
    gap, by_state, by_torque, by_time = gaps(PROBLEM.robot, motion, 0)
    k, step = 5, 1e-5
    x, tau = motion.x.copy(), motion.tau.copy()
    x[k] += step * motion.size * np.array([1, 0, 0, 0])
    moved = replace(motion, x=x)
    other = gaps(PROBLEM.robot, moved, 0)[0]
    # Derivatives are those at the middle of a step: right to the square of its length.
    assert np.max(np.abs((other - gap)[k] * moved.size / motion.size / step - by_state[k, :, 0])) < 1e-2
    tau[k, :, 1] -= 1e-5
    other = gaps(PROBLEM.robot, replace(motion, tau=tau), 0)[0]
    assert np.allclose((other - gap)[k] / -1e-5, by_torque[k, :, 1], rtol=1e-2, atol=1e-6)
    other = gaps(PROBLEM.robot, replace(motion, t=motion.t * (1 + 1e-6)), 0)[0]
    assert np.allclose((other - gap) / 1e-6, by_time, rtol=1e-2, atol=1e-5)


def test_a_mesh_that_is_far_from_any_motion_does_not_land():
    task, attempt = found()
    motion = attempt.trajectory
    far = replace(attempt, trajectory=replace(motion, tau=np.zeros_like(motion.tau), v=10 * motion.v))
    assert landed(task, far) is None
    replay = replay_on_goal(task, far)  # and is left alone
    assert not replay.tau.any()
    assert replay.duration == pytest.approx(motion.duration, rel=1e-12)


@pytest.mark.parametrize("friction", [0.0, 0.05])
def test_the_torques_of_a_mesh_change_a_little_and_land(friction):
    bare = paper_problem("rr", velocity_limit=15.0)
    robot = bare.robot.with_friction(friction, friction)
    problem = ad.MinimumTimeProblem(robot, q_start=bare.q_start, q_goal=bare.q_goal, velocity_limit=15.0)
    task = Task.of(problem)
    found = solve_on_mesh(task, spline(problem, []), 40, task.alone())
    before = miss(problem, ad.replay_torques(robot, found.trajectory))
    assert before > 1e-6
    replay = replay_on_goal(task, found)
    # Its tolerance, in rad; 1e-6 rad/s is 1e-7 of the speeds.
    assert np.abs(replay.q[-1] - problem.q_goal).max() < 1e-8
    assert miss(problem, replay) < 1e-6
    assert np.all(np.abs(replay.tau) <= problem.limits.effort_upper)
    # The change is about as large as the miss, not as the motion.
    assert replay.duration == pytest.approx(found.trajectory.duration, rel=10 * before)


def on_mesh(t, tau):
    """Motion of a cart on a mesh of equal intervals under given forces."""
    both, force = both_sides(t), np.repeat(tau, 2)[:, None]
    v = np.minimum(both, both[-1] - both)[:, None]
    motion = ad.Trajectory(both, np.zeros_like(v), v, force, cart().joint_names)
    return Attempt(ad.Status.SOLVED, "", motion, len(tau), 0, None)


def test_a_mesh_lands_exactly_where_the_answer_is_known():
    """A cart's torques that are a little weak: the double integrator's way is linear in the force."""
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    t = np.linspace(0, 3, 31)
    replay = replay_on_goal(Task.of(problem), on_mesh(t, np.where(t[:-1] < 1.5, 1, -1) * 2.0 / 1.5**2 * 0.99))
    assert replay.q[-1, 0] == pytest.approx(2.0, abs=1e-9)
    assert np.abs(replay.tau).max() <= 1.0
