"""Which of several joint positions that reach a goal is reached fastest."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.models.scene.reaching import free_directions, slid
from armdyn.optimal.answer.assembly import slid_end
from armdyn.optimal.curves.goals import screened
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.costates import end_gradient, transversality
from oracles import robot_named
from problems import mesh_alone, paper_arm

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
    messages = []
    tasks, tried = screened(Task.of(problem, progress=messages.append))
    assert len(messages) == 1 and len(tried) == len(tasks) == 2
    # 0.3 rad at no more than 1 rad/s, gained and lost; the other elbow is 0.7 rad away.
    np.testing.assert_allclose(tried[0].q, near, atol=1e-8)
    assert 0.3 < tried[0].duration < 0.5 and tried[1].duration == np.inf
    assert tried[1].q[1] == pytest.approx(-0.5, abs=1e-8) and tasks[1].problem.duration_bound() > 0.7 - 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("region", [{"free": ("rz",)}, {"tolerance": (0.02, 0.02, 0.02, 0.1, 0.1, 0.1)}])
def test_a_curve_chooses_its_end_within_a_region(region):
    robot = ad.Robot.from_library("ur5")
    at = placement(robot, GOAL)
    goal = ad.GoalPose(robot.tip, at, **region)
    problem = ad.MinimumTimeProblem(robot, q_start=START, goal_pose=goal)
    tasks, _ = screened(Task.of(problem))
    chosen = [task for task in tasks if task.options.guesses]
    assert chosen  # by its program, and no sample
    for task in chosen:
        q = np.asarray(task.problem.q_goal)
        assert min(np.max(np.abs(q - sample)) for sample in problem.goals) > 1e-3
        off = at.actInv(placement(robot, q))
        beside = np.abs([*off.translation, *pin.log3(off.rotation)])
        if goal.axis is not None:
            beside[3:] = np.abs(off.rotation[:, 2] - [0, 0, 1])
        assert np.all(beside <= goal.deviations + 1e-8)
        # Ends at rest there, no later than the samples do.
        motion = task.options.guesses[0]
        np.testing.assert_allclose(motion.v[-1], 0, atol=1e-6)
        np.testing.assert_allclose(motion.q[-1], q, atol=1e-6)


@pytest.mark.slow
def test_arcs_to_a_region_are_usable_and_not_called_extremal():
    robot = paper_arm("rr")
    at = placement(robot, np.array([0.2, 0.5]))
    goals = [ad.GoalPose(robot.tip, at.translation, tolerance=(size, 0, size, 0, 0, 0)) for size in (0.0, 0.01)]
    exact, near = (
        ad.solve_minimum_time(ad.MinimumTimeProblem(robot, q_start=[-1.0, 0.3], goal_pose=goal)) for goal in goals
    )
    assert exact.certified and near.usable and not near.certificate.extremal
    assert "whether another joint position of the goal is faster is not checked" in near.message
    off = placement(robot, near.problem.x_goal[:2]).translation - at.translation
    assert np.all(np.abs(off) <= [0.01 + 1e-8, 1e-8, 0.01 + 1e-8]) and near.duration < exact.duration


@pytest.mark.slow
def test_eight_branches_of_a_ur5_are_compared_as_coarse_curves():
    robot = ad.Robot.from_library("ur5")
    problem = ad.MinimumTimeProblem(robot, q_start=START, goal_pose=ad.GoalPose(robot.tip, placement(robot, GOAL)))
    tasks, tried = screened(Task.of(problem))
    assert len(tried) == len(problem.goals) == 8 and len(tasks) == 2
    np.testing.assert_array_equal(tasks[0].problem.q_goal, tried[0].q)
    solution = ad.solve_minimum_time(problem)
    assert solution.success and solution.goals[0].refined
    # 16 intervals instead of 56.
    assert solution.duration <= tried[0].duration == pytest.approx(solution.duration, rel=0.02)
    # Velocity limits alone put all other branches behind it.
    others = [problem.variant(q_goal=q, goal_pose=None) for q in problem.goals if np.any(q != solution.problem.q_goal)]
    assert len(others) == 7 and all(other.duration_bound() > solution.duration for other in others)


@pytest.mark.slow
def test_an_extremal_end_is_orthogonal_to_the_joint_positions_that_reach_its_pose():
    robot = paper_arm("rrr")
    start, goal = np.split(np.random.default_rng(1).uniform(-1.5, 1.5, 6), 2)
    pose = ad.GoalPose(robot.tip, placement(robot, goal).translation)
    problem = ad.MinimumTimeProblem(robot, q_start=start, goal_pose=pose)
    solution = ad.solve_minimum_time(problem)
    certificate = solution.certificate
    assert certificate.extremal == (certificate.transversality < 1e-3)
    assert certificate.extremal and solution.certified
    # Either neighbour along the goals is slower, and the costates' error gives the difference at a goal further on.
    q = solution.problem.x_goal[:3]
    (free,) = free_directions(robot, pose, q).T
    for side in (-0.03, 0.03):
        near = slid(robot, pose, q, side * free, problem.limits)
        options = ad.MinimumTimeOptions(guesses=(solution.trajectory,), starts=1)
        other = ad.solve_minimum_time(problem.variant(q_goal=near, goal_pose=None), options)
        assert other.certificate.extremal and other.duration > solution.duration
        missed = transversality(problem, pose, near, other.costates)
        assert missed > 1e-3 and not replace(other.certificate, transversality=missed).extremal
        slope = end_gradient(robot, pose, near, other.costates)
        assert slope @ (near - q) > 0


@pytest.mark.slow
def test_an_end_descends_along_its_pose_by_the_costates_of_meshes():
    robot = paper_arm("rrr")
    start, goal = np.split(np.random.default_rng(1).uniform(-1.5, 1.5, 6), 2)
    pose = ad.GoalPose(robot.tip, placement(robot, goal).translation)
    posed = ad.MinimumTimeProblem(robot, q_start=start, goal_pose=pose)
    fastest = np.array([0.48032713, 0.52767955, 0.27926917])  # of exact arcs, where transversality is missed by 1e-5
    (free,) = free_directions(robot, pose, fastest).T

    def solved(near, seconds):
        return mesh_alone(near.problem, guesses=near.options.guesses, starts=near.options.starts)

    first = mesh_alone(posed.variant(q_goal=slid(robot, pose, fastest, 0.05 * free, posed.limits), goal_pose=None))
    assert transversality(posed, pose, first.problem.x_goal[:3], first.costates) > 5e-3
    last = slid_end(Task.of(posed), first, solved)
    assert last.phases is None and transversality(posed, pose, last.problem.x_goal[:3], last.costates) < 1e-3
    assert last.duration == pytest.approx(0.16528390, rel=2e-6)  # with arcs; the mesh is a millionth slower
    np.testing.assert_allclose(last.problem.x_goal[:3], fastest, atol=2e-3)  # of second order in the duration


@pytest.mark.slow
def test_an_end_that_lies_on_a_position_limit_is_reached():
    # The program chooses 2.8973 rad for joint 3, its limit. From the straight way IPOPT does not converge there.
    start = [2.2234705, 0.03744724, 2.37184135, -2.30032929, 0.53262421, 0.92272373, 1.49919244]
    goal = [1.64350303, -1.14522922, 2.89729946, -0.61737605, 0.27336133, 1.19623729, 1.34669916]
    robot = robot_named("panda")
    beside = ad.MinimumTimeProblem(robot, q_start=start, q_goal=[*goal[:2], 2.5, *goal[3:]])
    motion = ad.solve_minimum_time(beside, ad.MinimumTimeOptions(bound=False))
    options = ad.MinimumTimeOptions(guesses=[motion.trajectory])  # one more guess, of no use here
    problem = ad.MinimumTimeProblem(robot, q_start=start, q_goal=goal)
    solution = ad.solve_minimum_time(problem, options)
    assert solution.duration == pytest.approx(0.7801, rel=2e-3)  # of the best seed
    assert solution.usable and 0 < solution.gap < 0.01  # a proven bound, of which the search knows nothing
