"""Poses with names: SRDFs next to a URDF, untrusted ones, and the table."""

import math
import time

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError, SpecError
from armdyn.models.robots.poses import TABLE
from models.mjcf.arms import mjcf, one, two

SRDF = """<robot name="{robot}">
  <group_state name="home" group="arm"><joint name="joint1" value="0.1"/><joint name="joint2" value="-0.2"/>
    <joint name="finger" value="1"/></group_state>
  <group_state name="half" group="arm"><joint name="joint1" value="0.1"/></group_state>
  <group_state name="free"><joint name="joint1" value="0 0 0 1"/><joint name="joint2" value="0"/></group_state>
  <group_state name="nowhere"><joint name="joint1" value="nan"/><joint name="joint2" value="0"/></group_state>
</robot>"""


@pytest.fixture
def arm(tmp_path):
    """A URDF in a package's folder; `poses()` are those of it as it then is."""
    (tmp_path / "urdf").mkdir()
    (tmp_path / "srdf").mkdir()
    path = tmp_path / "urdf" / "mine.urdf"
    path.write_text(ad.urdf_from_spec(ad.ArmSpec.paper("rr")))
    return path


def poses(arm):
    return {name: q.tolist() for name, q in ad.Robot.from_urdf(arm).poses.items()}


@pytest.mark.parametrize("place", ["urdf/mine.srdf", "srdf/mine.srdf"])
def test_an_srdf_of_the_same_name(arm, place):
    assert poses(arm) == {"zero": [0.0, 0.0]}
    (arm.parents[1] / place).write_text(SRDF.format(robot="anything"))
    assert poses(arm) == {"zero": [0.0, 0.0], "home": [0.1, -0.2]}


def test_an_srdf_that_names_the_robot(arm):
    other = arm.parents[1] / "srdf" / "other.srdf"
    other.write_text(SRDF.format(robot="somebody"))
    assert poses(arm) == {"zero": [0.0, 0.0]}
    other.write_text(SRDF.format(robot=ad.Robot.from_urdf(arm).name))
    assert poses(arm)["home"] == [0.1, -0.2]


@pytest.mark.parametrize(
    "content",
    [
        "not XML", "<robot", "", "<other/>", "<!DOCTYPE robot [<!ENTITY a 'b'>]><robot name='rr'>&a;</robot>",
        "<robot name='rr'>" + "<group_state>" * 200, '<robot name="rr"><group_state name="a&#10;b"/></robot>',
    ],
)  # fmt: skip
def test_a_bad_file_is_as_none(arm, content):
    (arm.parent / "mine.srdf").write_text(content)
    assert poses(arm) == {"zero": [0.0, 0.0]}


def test_devices_and_folders_are_not_waited_for(arm):
    import os

    os.mkfifo(arm.parent / "mine.srdf")
    (arm.parents[1] / "srdf" / "mine.srdf").mkdir()
    begun = time.monotonic()
    assert poses(arm) == {"zero": [0.0, 0.0]}
    assert time.monotonic() - begun < 60  # an open of a pipe would wait for good


def test_a_robot_without_a_file_has_no_srdf():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    assert list(robot.poses) == ["zero"]
    with pytest.raises(SpecError, match=r"no pose 'home' \(known: zero\)"):
        robot.pose("home")


def test_zero_is_a_pose_where_the_limits_allow_it():
    assert "zero" not in ad.Robot.from_library("panda").poses


@pytest.mark.parametrize(
    ("name", "pose"), [("panda", "default"), ("xarm7", "hold-up"), ("z1", "arm_up"), ("talos_left", "half_sitting")]
)
def test_the_library_s_own(name, pose):
    robot = ad.Robot.from_library(name)
    assert robot.pose(pose).shape == (robot.nv,) and robot.pose(pose).any()


@pytest.mark.parametrize("name", ["ur3", "ur5", "ur10", "panda"])
def test_the_table_s_are_within_the_limits(name):
    robot = ad.Robot.from_library(name)
    table = next(poses for joints, poses in TABLE if joints == robot.joint_names)
    for pose, q in table.items():
        assert np.array_equal(robot.pose(pose), q)
        assert np.all((robot.limits.position_lower <= q) & (np.asarray(q) <= robot.limits.position_upper))


def test_ready_is_the_library_s_default_pose():
    """Two sources of one pose; the SRDF has pi/2 with five digits."""
    panda = ad.Robot.from_library("panda")
    assert panda.pose("ready") == pytest.approx(panda.pose("default"), abs=1e-4)
    assert panda.pose("ready")[1] == -math.pi / 4


def test_locked_joints_are_left_out_of_the_poses():
    whole, held = (ad.Robot.from_library("ur5", lock=lock) for lock in (None, {"elbow_joint": 1.0}))
    assert {name: q.tolist() for name, q in held.poses.items()} == {
        name: np.delete(q, 2).tolist() for name, q in whole.poses.items()
    }
    assert {"home", "up", "zero"} == held.poses.keys()


def test_names_stand_where_poses_do():
    """In Python as on the command line."""
    panda = ad.Robot.from_library("panda")
    ready = panda.pose("ready")
    there = ready + 0.1
    problem = ad.MinimumTimeProblem(panda, q_start="ready", q_goal=there, via=["default"])
    assert np.array_equal(problem.q_start, ready) and np.array_equal(problem.via[0], panda.pose("default"))
    assert np.array_equal(ad.ramp(panda, "ready", there, 1.0).q[0], ready)
    assert np.array_equal(ad.set_point(panda, "ready").q[0], ready)
    assert panda.pose("ready")[0] == ready[0] == 0.0, "a problem keeps a pose of its own"


@pytest.mark.parametrize("ends", [("raedy", [0.1] * 7), ([0.1] * 7, "raedy")])
def test_a_name_that_is_none_is_a_problem_and_says_which_there_are(ends):
    panda = ad.Robot.from_library("panda")
    with pytest.raises(ProblemError, match=r"a number per joint.*did you mean 'ready'"):
        ad.MinimumTimeProblem(panda, q_start=ends[0], q_goal=ends[1])
    with pytest.raises(ProblemError, match="did you mean 'ready'"):
        ad.simulate_pid(panda, q_start=ends[0], q_goal=ends[1], duration=0.1)


def test_two_groups_have_a_pose_of_one_name(arm):
    gripper = '<group_state name="home" group="gripper"><joint name="finger" value="1"/></group_state></robot>'
    (arm.parent / "mine.srdf").write_text(SRDF.format(robot="rr").replace("</robot>", gripper))
    assert poses(arm)["home"] == [0.1, -0.2]


def test_keyframes_of_an_mjcf(tmp_path):
    """MuJoCo's qpos: a free base's seven numbers first, a ball's four among them, angles in radians in any MJCF."""
    import mujoco

    base = (
        '<body name="base"><freejoint name="base"/><geom size="0.1" mass="1"/>'
        + two(joint='<joint name="k" range="-90 90"/>')
        + one('<joint name="eye" type="ball"/>', name="head")
        + one('<joint name="drawer" type="slide"/>', name="drawer")
        + "</body>"
    )
    numbers = "0 0 0 1 0 0 0  0.5 -0.25  1 0 0 0  0.1"
    keys = (
        f'<keyframe><key name="home" qpos="{numbers}"/><key qpos="{numbers}"/><key name="short" qpos="1 2"/></keyframe>'
    )
    path = tmp_path / "arm.xml"
    path.write_text(mjcf(base, keys))
    robot = ad.Robot.from_mjcf(path, lock={"base": 0.0, "eye": 0.0})
    theirs = mujoco.MjModel.from_xml_path(str(path))
    home = [theirs.key("home").qpos[theirs.joint(name).qposadr[0]] for name in robot.joint_names]
    assert robot.joint_names == ("j", "k", "drawer")
    assert robot.poses.keys() == {"zero", "home"}
    assert robot.pose("home").tolist() == home == [0.5, -0.25, 0.1]
    assert ad.Robot.from_mjcf_string(path.read_text(), lock={"base": 0.0, "eye": 0.0}).poses.keys() == {"zero"}
