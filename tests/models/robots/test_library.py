import numpy as np
import pinocchio as pin
import pytest

from armdyn.errors import UnknownRobotError, UnsupportedJointError, UrdfError
from armdyn.models import Robot
from armdyn.models.reading.urdf_arm import configuration
from armdyn.models.robots.library import LIBRARY_ARMS, library_arm, library_urdf, other_robots
from armdyn.models.robots.source import RobotSource

DOF = {
    "anymal_kinova_arm": 6, "asr_twodof": 2, "b1_z1_arm": 6, "baxter_left": 7, "baxter_right": 7, "bravo7_gripper": 6,
    "bravo7_no_ee": 6, "centauro_left": 6, "centauro_right": 6, "double_pendulum": 2, "double_pendulum_continuous": 2,
    "double_pendulum_simple": 2, "finger_edu": 3, "kinova": 6, "panda": 7, "panda_collision": 7, "pr2_left": 7,
    "pr2_right": 7, "so100": 5, "so101": 5, "talos_arm": 6, "talos_left": 7, "talos_right": 7, "tiago_arm": 7,
    "tiago_dual_left": 7, "tiago_dual_right": 7, "tiago_no_hand_arm": 7, "tiago_pro_left": 7, "tiago_pro_right": 7,
    "ur10": 6, "ur10_limited": 6, "ur3": 6, "ur3_gripper": 6, "ur3_limited": 6, "ur5": 6, "ur5_gripper": 6,
    "ur5_limited": 6, "xarm7": 7, "z1": 6,
}  # fmt: skip
"""Joints of the arms themselves, from their makers' descriptions."""


def symmetric(upper):
    return np.triu(upper) + np.triu(upper, 1).T


def test_table_is_whole():
    assert set(DOF) == set(LIBRARY_ARMS)
    assert list(LIBRARY_ARMS) == sorted(LIBRARY_ARMS)


@pytest.mark.parametrize("name", LIBRARY_ARMS)
def test_arm(name):
    """Of the whole robot's equations of motion, with all else at rest where it is locked, the arm's rows remain."""
    robot = Robot.from_library(name)
    assert robot.nv == DOF[name]
    whole = pin.buildModelFromUrdf(str(library_arm(name)[0]))
    joints = list(whole.names)[1:]
    assert sorted([*robot.joint_names, *robot.locked]) == sorted(joints)
    tip = robot.frame(robot.tip)
    assert tip.type == pin.FrameType.BODY and tip.parentJoint == robot.nv  # behind every joint

    arm = [whole.joints[whole.getJointId(joint)].idx_v for joint in robot.joint_names]
    q, v = np.linspace(-1.0, 1.5, robot.nv), np.linspace(1.0, -2.0, robot.nv)
    placed = robot.locked | dict(zip(robot.joint_names, q, strict=True))
    q_whole, v_whole = configuration(whole, [placed[joint] for joint in joints]), np.zeros(whole.nv)
    v_whole[arm] = v
    mass = symmetric(pin.crba(whole, whole.createData(), q_whole))[np.ix_(arm, arm)]
    other = pin.nonLinearEffects(whole, whole.createData(), q_whole, v_whole)[arm]
    model, own = robot.model, robot.configuration(q)
    # Some hundred additions of inertias up to 100 kg m² in another order.
    np.testing.assert_allclose(symmetric(pin.crba(model, model.createData(), own)), mass, rtol=1e-10, atol=1e-12)
    np.testing.assert_allclose(pin.nonLinearEffects(model, model.createData(), own, v), other, rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("name", ["ur5", "kinova", "bravo7_no_ee", "icub_reduced"])
def test_the_model_is_pinocchios_model_of_the_whole_urdf(name):
    robot, expected = Robot.from_library(name), pin.buildModelFromUrdf(str(library_arm(name)[0]))
    assert robot.model == expected


def test_default_locks_are_within_their_range():
    for name, arm in LIBRARY_ARMS.items():
        robot, whole = Robot.from_library(name), pin.buildModelFromUrdf(str(library_urdf(arm.robot)[0]))
        for joint, position in robot.locked.items():
            found = whole.joints[whole.getJointId(joint)]
            if found.nq == 1:
                low, high = whole.lowerPositionLimit[found.idx_q], whole.upperPositionLimit[found.idx_q]
                assert low <= position <= high
                assert position == 0.0 or not low <= 0.0 <= high, (name, joint)


def test_lock_adds_to_the_default():
    robot = Robot.from_library("baxter_left", lock={"left_w2": 0.3, "head_pan": 0.5})
    assert robot.nv == 6
    assert robot.locked["head_pan"] == 0.5 and robot.locked["r_gripper_l_finger_joint"] == 0.0


def test_another_arm_of_a_named_robot():
    robot = Robot.from_library("baxter", arm=("right_s0", "right_gripper"))
    same = Robot.from_library("baxter_right")
    assert robot.model == same.model and robot.tip == "right_gripper"
    assert Robot.from_library("panda", arm=("panda_joint1", "panda_joint3")).nv == 3


def test_a_robot_of_several_limbs():
    fingers = {f"{side}_gripper_{end}_finger_joint": 0.0 for side in "lr" for end in "lr"}
    baxter = Robot.from_library("baxter")
    assert baxter.locked == fingers and "arm=('left_s0', 'left_w2') or arm=('right_s0', 'right_w2')" in baxter.notes[1]
    with pytest.raises(UnsupportedJointError, match="'l_gripper_l_finger_joint', which moves") as caught:
        Robot.from_library("baxter", lock={"l_gripper_l_finger_joint": "free"})
    assert caught.value.element == "joint 'l_gripper_r_finger_joint'"
    assert set(Robot.from_library("talos").locked) == {"gripper_left_joint", "gripper_right_joint"}


def test_hashes_tell_arms_apart():
    assert len({Robot.from_library(name).model_hash for name in ("ur3", "ur5", "ur10", "panda", "z1")}) == 5
    # These differ in limits and collision shapes only.
    assert Robot.from_library("ur5").model_hash == Robot.from_library("ur5_limited").model_hash


def test_ur3_is_a_ur3():
    """Universal Robots: 3 kg of payload, 11 kg of mass, 0.5 m of reach; a UR5 has 5 kg, 18.4 kg and 0.85 m."""
    robot = Robot.from_library("ur3")
    assert robot.name == "ur3"
    assert sum(inertia.mass for inertia in robot.model.inertias) == pytest.approx(11.0, abs=1.0)
    assert robot.model.jointPlacements[3].translation[2] == pytest.approx(0.24365, abs=1e-5)


def test_others():
    assert "talos_full" in other_robots() and "baxter" not in other_robots() and "panda" not in other_robots()


def test_unknown_robot_knows_the_arms_too():
    with pytest.raises(UnknownRobotError) as caught:
        Robot.from_library("r2d2")
    assert {"baxter", "baxter_left"} <= set(caught.value.known)
    with pytest.raises(UnknownRobotError):
        library_urdf("baxter_left")


def test_robot_described_by_sdf():
    with pytest.raises(UrdfError, match="SDF"):
        Robot.from_library("cassie")


@pytest.mark.parametrize("name", ["trajectory.npz", "log.csv", "result.json"])
def test_files_of_motions_and_logs_are_no_robots(name):
    with pytest.raises(UrdfError, match=f"{name}: no robot: a robot is a URDF or MJCF file, a problem file"):
        RobotSource.named(name)
