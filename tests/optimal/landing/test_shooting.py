"""Multiple shooting from a mesh's motion, against the replay."""

from dataclasses import replace

import numpy as np

import armdyn as ad
from armdyn.optimal.landing.rollout import replay_of
from armdyn.optimal.landing.shooting import Shooting, gaps, landed
from armdyn.optimal.search.candidates import find
from armdyn.optimal.task.task import Task
from problems import paper_problem

PROBLEM = paper_problem("rr")


def found():
    """A task and a solution on a mesh."""
    task = Task.of(PROBLEM, ad.MinimumTimeOptions(starts=4, workers=1))
    return task, find(task).attempts[0]


def test_the_replay_of_a_landed_mesh_ends_on_the_goal_within_the_torque_limits():
    task, attempt = found()
    before = replay_of(task, attempt.trajectory)
    assert np.max(np.abs(PROBLEM.beside_goal(before))) > 1e-5
    motion = landed(task, attempt)
    replay = replay_of(task, motion.trajectory(PROBLEM.robot.joint_names))
    assert np.max(np.abs(PROBLEM.beside_goal(replay))) < 1e-7  # two integrators, steps of a 25th of the motion
    assert np.all(PROBLEM.limits.actuators.allows(motion.tau, motion.x[:-1, :2], motion.x[:-1, 2:]))
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
    tau[k, 1] -= 1e-5
    other = gaps(PROBLEM.robot, replace(motion, tau=tau), 0)[0]
    assert np.allclose((other - gap)[k] / -1e-5, by_torque[k, :, 1], rtol=1e-2, atol=1e-6)
    other = gaps(PROBLEM.robot, replace(motion, t=motion.t * (1 + 1e-6)), 0)[0]
    assert np.allclose((other - gap) / 1e-6, by_time, rtol=1e-2, atol=1e-5)


def test_a_mesh_that_is_far_from_any_motion_does_not_land():
    task, attempt = found()
    motion = attempt.trajectory
    far = replace(attempt, trajectory=replace(motion, tau=np.zeros_like(motion.tau), v=10 * motion.v))
    assert landed(task, far) is None
