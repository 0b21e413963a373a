"""Inverse kinematics against forward kinematics, and against known facts of the arms."""

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError, SpecError
from armdyn.models.scene.reaching import GoalPose, free_directions, poses_reaching
from oracles import robot_named


def placement(robot, frame, q):
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.configuration(q))
    at = robot.frame(frame)
    return data.oMi[at.parentJoint] * at.placement


@pytest.mark.parametrize("name", ["ur5", "panda", "kinova"])
def test_solutions_reach_the_goal_within_the_limits(name):
    robot = robot_named(name)
    random = np.random.default_rng(1)
    low, high = np.maximum(robot.limits.position_lower, -2), np.minimum(robot.limits.position_upper, 2)
    wanted = placement(robot, robot.tip, random.uniform(low, high))
    found = poses_reaching(robot, GoalPose(robot.tip, wanted), np.zeros(robot.nv) + 0.1, robot.limits, most=20)
    assert len(found) >= (8 if name == "ur5" else 3)  # a UR5 has eight branches
    for q in found:
        assert np.all(q >= robot.limits.position_lower) and np.all(q <= robot.limits.position_upper)
        # 1e-9 counts as reached; whole turns cost rounding.
        np.testing.assert_allclose(placement(robot, robot.tip, q).homogeneous, wanted.homogeneous, atol=1e-8)
    for i, q in enumerate(found):
        assert all(np.max(np.abs(q - other)) > 0.3 for other in found[:i])


def test_two_links_have_an_elbow_up_and_an_elbow_down():
    robot = robot_named("rr")
    found = poses_reaching(robot, GoalPose("tip", [0.3, 0.0, 0.2]), [0.0, 0.0], robot.limits)
    assert len(found) == 2
    # The cosine theorem.
    elbow = np.arccos((0.3**2 + 0.2**2 - 0.25**2 - 0.234**2) / (2 * 0.25 * 0.234))
    np.testing.assert_allclose(sorted(q[1] for q in found), [-elbow, elbow], atol=1e-8)


def test_out_of_reach_says_how_far():
    robot = robot_named("rr")
    with pytest.raises(ProblemError, match=r"0\.148 m away"):  # √(0.6² + 0.2²) − 0.484
        poses_reaching(robot, GoalPose("tip", [0.6, 0.0, 0.2]), [0.0, 0.0], robot.limits)
    with pytest.raises(ProblemError, match="rad"):  # out of its plane
        poses_reaching(robot, GoalPose("tip", pin.SE3(pin.rpy.rpyToMatrix(1, 0, 0), np.zeros(3))), [0, 0], robot.limits)
    with pytest.raises(ProblemError, match="does not move"):
        poses_reaching(robot, GoalPose("base", [0.0, 0.0, 0.0]), [0.0, 0.0], robot.limits)
    with pytest.raises(SpecError, match="nowhere"):
        poses_reaching(robot, GoalPose("nowhere", [0.0, 0.0, 0.0]), [0.0, 0.0], robot.limits)
    with pytest.raises(ProblemError, match="goal pose"):
        GoalPose("tip", [1.0, 2.0])


def test_a_problem_takes_a_goal_pose():
    robot = robot_named("rr")
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0, 0.0], goal_pose=GoalPose("tip", [0.3, 0.0, 0.2]))
    assert len(problem.goals) == 2
    np.testing.assert_array_equal(problem.q_goal, problem.goals[0])
    with pytest.raises(ProblemError, match="`q_goal` or `goal_pose`"):
        ad.MinimumTimeProblem(robot, q_start=[0.0, 0.0])


PLACE = [0.4, -0.9, 1.1, -1.7, -1.4, 0.3]
WITHIN = (0.01, 0.02, 0.0, 0.0, 0.1, 0.05)


@pytest.mark.slow
def test_a_region_is_reached_by_other_joint_positions_than_its_pose():
    robot = robot_named("ur5")
    pose = placement(robot, robot.tip, np.array(PLACE))
    free = GoalPose(robot.tip, pose, free=("rz",))
    angles = set()
    for q in poses_reaching(robot, free, np.zeros(6) + 0.3, robot.limits):
        off = pose.actInv(placement(robot, robot.tip, q))
        np.testing.assert_allclose(off.translation, 0, atol=1e-8)
        np.testing.assert_allclose(off.rotation[:, 2], [0, 0, 1], atol=1e-8)
        angles.add(round(float(np.arctan2(off.rotation[1, 0], off.rotation[0, 0])), 3))
        assert free_directions(robot, free, q).shape == (6, 1)
    assert len(angles) > 2
    for q in poses_reaching(robot, GoalPose(robot.tip, pose, tolerance=WITHIN), np.zeros(6) + 0.3, robot.limits):
        off = pose.actInv(placement(robot, robot.tip, q))
        assert np.all(np.abs([*off.translation, *pin.log3(off.rotation)]) <= np.array(WITHIN) + 1e-8)


def test_a_tilted_tool_that_may_turn_is_within_its_tolerance():
    robot = robot_named("ur5")
    pose = placement(robot, robot.tip, np.array(PLACE))
    goal = GoalPose(robot.tip, pose, free=("rz",), tolerance=(0, 0, 0, 0.3, 0.0, 0))
    for q in poses_reaching(robot, goal, np.zeros(6) + 0.3, robot.limits):
        axis = pose.actInv(placement(robot, robot.tip, q)).rotation[:, 2]
        assert abs(axis[0]) < 1e-8 and np.arctan2(abs(axis[1]), axis[2]) <= 0.3 + 1e-8


@pytest.mark.parametrize(
    ("region", "said"),
    [
        ({"free": "rz"}, "free is 'rz'; it is a tuple of some of x, y, z, rx, ry, rz"),
        ({"free": ("rx", "ry")}, "one free rotation or three"),
        ({"tolerance": (0.1,)}, "has 1 numbers; it takes x, y, z, rx, ry, rz"),
        ({"tolerance": (0, 0, 0, 0, 0, -1)}, "tolerance of a goal pose is -1"),
        ({"tolerance": (0, 0, 0, 0, 0, 1), "free": ("rz",)}, "rz of a goal pose is free and has a tolerance"),
    ],
)
def test_bad_regions(region, said):
    with pytest.raises(ProblemError, match=said):
        GoalPose("tool0", np.eye(4), **region)
    with pytest.raises(ProblemError, match="position"):
        GoalPose("tool0", [0, 0, 0], **(region | {"free": ("rz",), "tolerance": ()}))
