"""Which of several joint positions that reach a goal is reached fastest."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.models.scene.reaching import free_directions, slid
from armdyn.optimal.proof.transversality import end_gradient, transversality
from armdyn.optimal.search.goals import screened
from armdyn.optimal.task.task import Task
from problems import paper_arm

START, GOAL = [0, -1, 1, -1, -1.5, 0], np.array([-1.5, -1.8, 1.6, -0.4, 0.3, 1.0])


def placement(robot, q):
    """Where the tip is at q."""
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.configuration(q))
    at = robot.frame(robot.tip)
    return data.oMi[at.parentJoint] * at.placement


def test_a_goal_that_velocity_limits_put_far_behind_is_not_tried():
    robot, near = paper_arm("rr"), np.array([0.2, 0.5])
    place = ad.GoalPose(robot.tip, placement(robot, near).translation)
    problem = ad.MinimumTimeProblem(robot, q_start=near - 0.3, goal_pose=place, velocity_limit=1.0)
    told = []
    branches, tried = screened(Task.of(problem, progress=told.append))
    assert len(told) == 1 and len(tried) == len(branches) == 2
    # 0.3 rad at no more than 1 rad/s, gained and lost; the other elbow is 0.7 rad away.
    np.testing.assert_allclose(tried[0].q, near, atol=1e-8)
    assert 0.3 < tried[0].duration < 0.5 and tried[1].duration == np.inf
    assert tried[1].q[1] == pytest.approx(-0.5, abs=1e-8) and branches[1].duration_bound() > 0.7 - 1e-8


@pytest.mark.slow
def test_eight_branches_of_a_ur5_are_compared_as_coarse_curves():
    robot = ad.Robot.from_library("ur5")
    problem = ad.MinimumTimeProblem(robot, q_start=START, goal_pose=ad.GoalPose(robot.tip, placement(robot, GOAL)))
    branches, tried = screened(Task.of(problem))
    assert len(tried) == len(problem.goals) == 8 and len(branches) == 2
    np.testing.assert_array_equal(branches[0].q_goal, tried[0].q)
    solution = ad.solve_minimum_time(problem)
    assert solution.success and solution.goals[0].refined
    # 16 intervals instead of 56.
    assert solution.duration <= tried[0].duration == pytest.approx(solution.duration, rel=0.02)
    # Velocity limits alone put all other branches behind it.
    others = [problem.variant(q_goal=q, goal_pose=None) for q in problem.goals if np.any(q != solution.problem.q_goal)]
    assert len(others) == 7 and all(other.duration_bound() > solution.duration for other in others)


def test_an_extremal_end_is_orthogonal_to_the_joint_positions_that_reach_its_pose():
    robot = paper_arm("rrr")
    start, goal = np.split(np.random.default_rng(1).uniform(-1.5, 1.5, 6), 2)
    pose = ad.GoalPose(robot.tip, placement(robot, goal).translation)
    problem = ad.MinimumTimeProblem(robot, q_start=start, goal_pose=pose)
    solution = ad.solve_minimum_time(problem)
    certificate = solution.certificate
    assert certificate.extremal == (certificate.transversality < 1e-3)
    assert certificate.extremal and solution.certified
    # Either neighbour along the goals is slower, and what the costates miss by says how much at a goal further on.
    q = solution.problem.x_goal[:3]
    (free,) = free_directions(robot, pose, q).T
    for side in (-0.03, 0.03):
        near = slid(robot, pose, q, side * free, problem.limits)
        options = ad.MinimumTimeOptions(guesses=(solution.trajectory,), starts=1)
        other = ad.solve_minimum_time(problem.variant(q_goal=near, goal_pose=None), options)
        assert other.certificate.extremal and other.duration > solution.duration
        missed = transversality(problem, pose, near, other.phases)
        assert missed > 1e-3 and not replace(other.certificate, transversality=missed).extremal
        slope = end_gradient(robot, pose, near, other.phases)
        assert slope @ (near - q) > 0
