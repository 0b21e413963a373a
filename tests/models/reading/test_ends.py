"""Tips, grippers and chains of arms of other people's kinds."""

from contextlib import nullcontext

import pytest

import armdyn as ad
from armdyn.errors import ArmdynWarning, UnsupportedJointError
from armdyn.models.robots.library import library_urdf
from armdyn.models.robots.source import RobotSource
from oracles import LIMIT, joint, link, urdf

ARM = (
    '<link name="base"/>',
    *(link(name) for name in ("upper", "fore", "wrist", "palm")),
    joint("shoulder", "base", "upper"),
    joint("elbow", "upper", "fore"),
    joint("roll", "fore", "wrist"),
    joint("mount", "wrist", "palm", "fixed", ""),
)
"""Three joints and a palm."""


def fixed(parent, *names):
    """Links fixed to one link, each 50 mm beside the one before."""
    origins = (f'<origin xyz="0 {0.05 * i} 0.07"/>' for i in range(len(names)))
    joints = (joint(f"{name}_joint", parent, name, "fixed", at) for name, at in zip(names, origins, strict=True))
    return (*map(link, names), *joints)


def tip(*elements, **options):
    source = RobotSource(format="urdf", name="arm", text=urdf(*ARM, *elements))
    return ad.Robot.from_source(source, ad.RobotOptions(**options)).tip


@pytest.mark.parametrize(
    ("elements", "expected"),
    [
        (fixed("palm", "left_finger", "right_finger"), "palm"),
        ((*fixed("palm", "finger_1", "finger_2", "finger_3"), *fixed("finger_1", "finger_tip_1")), "palm"),
        (fixed("palm", "l_pad", "r_pad"), "palm"),  # alike but for the side
        ((*fixed("palm", "l_mount", "r_hold"), *fixed("l_mount", "a_jaw"), *fixed("r_hold", "b_jaw")), "palm"),
        (fixed("palm", "left_finger", "tool0", "right_finger"), "tool0"),
        ((*fixed("wrist", "camera"), *fixed("palm", "flange", "stand")), "flange"),  # no gripper: the longest chain
        (fixed("palm", "finger"), "finger"),  # one finger, with which it pushes
        (
            (*fixed("palm", "fixed_jaw"), link("moving_jaw"), joint("gripper", "palm", "moving_jaw", "fixed", "")),
            "palm",
        ),
    ],
)
def test_links_side_by_side_are_no_tip(elements, expected):
    assert tip(*elements) == expected


SLIDING = (
    link("left_finger"),
    link("right_finger"),
    joint("left_joint", "palm", "left_finger", "prismatic", LIMIT.replace("-1", "0.01")),
    joint("right_joint", "palm", "right_finger", "prismatic", f'{LIMIT}<mimic joint="left_joint"/>'),
)


def test_two_fingers_that_face_each_other_are_a_gripper():
    fingers = (joint(f"{side}_joint", "palm", side, "prismatic", f'<axis xyz="0 {y} 0"/>{LIMIT}')
               for side, y in (("left", 1), ("right", -1)))  # fmt: skip
    with pytest.warns(ArmdynWarning, match="gripper are locked: left_joint at 0, right_joint at 0"):
        robot = ad.Robot.from_urdf_string(urdf(*ARM, link("left"), link("right"), *fingers))
    assert (robot.nv, robot.tip) == (3, "palm")


def test_a_gripper_is_locked_with_a_note():
    text = urdf(*ARM, *SLIDING)
    with pytest.warns(ArmdynWarning, match=r"gripper are locked: left_joint at 0.01; .* lock=\{'left_joint': 'free'\}"):
        robot = ad.Robot.from_urdf_string(text)
    assert robot.joint_names == ("shoulder", "elbow", "roll") and robot.tip == "palm"
    assert robot.locked == {"left_joint": 0.01, "right_joint": 0.01} and robot.gripper == ("left_joint",)
    assert robot.with_payload(ad.Payload(mass=1.0)).joint_names == robot.joint_names
    given = ad.Robot.from_urdf_string(text, lock={"left_joint": 0.03})
    assert given.notes == [] and given.locked == {"left_joint": 0.03, "right_joint": 0.03}


def test_a_gripper_that_is_free_moves():
    with pytest.raises(UnsupportedJointError, match="mimics 'left_joint', which moves"):
        tip(*SLIDING, lock={"left_joint": "free"})
    alone = (link("left_finger"), joint("gripper", "palm", "left_finger"))
    robot = ad.Robot.from_urdf_string(urdf(*ARM, *alone), lock={"gripper": "free"})
    assert robot.joint_names[-1] == "gripper" and robot.locked == {} and robot.tip == "left_finger"
    with pytest.warns(ArmdynWarning, match="gripper at 0"):
        assert ad.Robot.from_urdf_string(urdf(*ARM, *alone)).tip == "palm"


def test_problem_files_keep_a_free_gripper(tmp_path):
    text = urdf(*ARM, link("jaw"), joint("gripper", "palm", "jaw"))
    robot = ad.Robot.from_urdf_string(text, lock={"gripper": "free"}, effort_limit=[50] * 4)
    problem = ad.MinimumTimeProblem(robot, q_start=[0] * 4, q_goal=[0.1] * 4)
    (tmp_path / "problem.toml").write_text(problem.to_toml())
    assert ad.read_problem(tmp_path / "problem.toml").robot.joint_names == robot.joint_names


@pytest.mark.parametrize(
    "elements",
    [
        # A coupled wrist: the follower is behind its leader, not next to it.
        (link("flap"), joint("pitch", "palm", "flap", inside=f'{LIMIT}<mimic joint="roll"/>')),
        # A palletiser's rod beside the arm, driven by a joint that carries the arm.
        (link("rod"), joint("rod", "base", "rod", inside=f'{LIMIT}<mimic joint="shoulder" multiplier="-1"/>')),
    ],
)
def test_joints_that_follow_an_arm_are_refused(elements):
    with pytest.raises(UnsupportedJointError, match=r"mimics .*, which moves.*docs/models.md"):
        tip(*elements)


def test_two_arms_are_proposed():
    sides = [
        (link(f"{side}_upper"), link(f"{side}_fore"), joint(f"{side}_1", "base", f"{side}_upper"),
         joint(f"{side}_2", f"{side}_upper", f"{side}_fore"))
        for side in ("left", "right")
    ]  # fmt: skip
    text = urdf('<link name="base"/>', *sides[0], *sides[1])
    choices = r"arm=\('left_1', 'left_2'\) or arm=\('right_1', 'right_2'\)"
    with pytest.warns(ArmdynWarning, match=choices):
        robot = ad.Robot.from_urdf_string(text)
    with pytest.raises(ad.ArmdynError, match=choices):
        ad.MinimumTimeProblem(robot, q_start=[0, 0], q_goal=[1, 1])
    assert ad.Robot.from_urdf_string(text, arm=("right_1", "right_2")).notes == []


@pytest.mark.parametrize(
    ("name", "joints", "expected"),
    [
        ("panda", 7, "panda_hand_tcp"),
        ("kinova", 6, "j2s6s200_end_effector"),
        ("so100", 5, "gripper"),
        ("so101", 5, "gripper_frame_link"),
        ("z1", 6, "gripperStator"),
        ("bravo7_gripper", 6, "force_torque_sensor"),
    ],
)
def test_files_of_the_library_without_a_word_are_its_arms(name, joints, expected):
    with pytest.warns(ArmdynWarning, match="gripper are locked") if name != "kinova" else nullcontext():
        robot = ad.Robot.from_urdf(library_urdf(name)[0])
    assert (robot.nv, robot.tip) == (joints, expected)
