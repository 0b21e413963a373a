import warnings

import numpy as np
import pinocchio as pin
import pytest

from armdyn.errors import SpecError, UnknownRobotError, UrdfError
from armdyn.models import PLANAR_ARMS, ArmSpec, Payload, Robot
from armdyn.models.robots.arm import payload_inertia
from armdyn.models.robots.library import library_urdf
from oracles import joint, link, random_states, robot_named, two_links, urdf


@pytest.mark.parametrize("arm", PLANAR_ARMS)
def test_from_spec(arm):
    robot = Robot.from_spec(ArmSpec.paper(arm))
    n = len(arm)
    assert (robot.name, robot.nv, robot.model.nq, robot.tip) == (arm, n, n, "tip")
    assert robot.joint_names == ("joint1", "joint2", "joint3")[:n]
    limits = robot.limits
    assert np.array_equal(limits.position_lower, np.full(n, -np.pi))
    assert np.array_equal(limits.position_upper, np.full(n, np.pi))
    assert np.array_equal(limits.velocity, np.full(n, 1000.0))
    assert np.array_equal(limits.effort_lower, np.full(n, -3.0))
    assert np.array_equal(limits.effort_upper, np.full(n, 3.0))
    assert robot.payload is None


def test_limits_are_read_only():
    with pytest.raises(ValueError, match="read-only"):
        robot_named("rr").limits.velocity[0] = 1.0


def test_spec_payload_is_pins_appended_inertia():
    payload = Payload(mass=0.3, com=(0.05, 0.01, 0.02), inertia=(1e-4, 2e-4, 2.5e-4))
    robot = Robot.from_spec(ArmSpec.paper("rr"), payload)
    bare = Robot.from_spec(ArmSpec.paper("rr"))
    tip = bare.frame("tip")
    bare.model.appendBodyToJoint(tip.parentJoint, payload_inertia(payload), tip.placement)
    # Both add two bodies with the same formulas; the sums round differently.
    assert robot.model.inertias[2].isApprox(bare.model.inertias[2], 1e-12)
    assert robot.payload == payload


def test_spec_payload_on_a_link_is_pins_appended_inertia():
    payload = Payload(mass=0.3, com=(0.05, 0.01, 0.02), inertia=(1e-4, 2e-4, 2.5e-4, 1e-5, 0, -2e-5), frame="link1")
    robot, bare = (Robot.from_spec(ArmSpec.paper("rr"), each) for each in (payload, None))
    bare.model.appendBodyToJoint(1, payload_inertia(payload), pin.SE3.Identity())
    # As above; a URDF has all the digits.
    assert robot.model.inertias[1].isApprox(bare.model.inertias[1], 1e-12)
    assert robot.model.inertias[2].isApprox(bare.model.inertias[2], 1e-12)


@pytest.mark.parametrize("frame", ["base", "hand"])
def test_spec_payload_on_a_fixed_link_is_refused(frame):
    with pytest.raises(SpecError, match=f"no moving link '{frame}'"):
        Robot.from_spec(ArmSpec.paper("rr"), Payload(mass=1.0, frame=frame))


@pytest.mark.parametrize("frame", [None, "panda_link4", "panda_hand"])
def test_urdf_payload_on_a_frame(frame):
    payload = Payload(mass=1.5, com=(0.0, 0.02, 0.1), inertia=(1e-3, 2e-3, 2.5e-3), frame=frame)
    bare, loaded = robot_named("panda"), Robot.from_library("panda", payload)
    place = bare.frame(frame or bare.tip)
    model = bare.model.copy()
    model.appendBodyToJoint(place.parentJoint, payload_inertia(payload), place.placement)
    for q, v, tau in random_states(7, count=2):
        expected = pin.aba(model, model.createData(), q, v, tau)
        assert np.allclose(pin.aba(loaded.model, loaded.model.createData(), q, v, tau), expected, rtol=1e-12)
    # Its mass is right, and the original robot is unchanged.
    assert loaded.model.inertias[place.parentJoint].mass == pytest.approx(
        bare.model.inertias[place.parentJoint].mass + 1.5, rel=1e-15
    )


def test_payload_on_no_or_a_fixed_frame():
    with pytest.raises(SpecError, match="no frame 'hand'"):
        Robot.from_library("ur5", Payload(mass=1.0, frame="hand"))
    with pytest.raises(SpecError, match=r"'base_link'.* does not move"):
        Robot.from_library("ur5", Payload(mass=1.0, frame="base_link"))


def test_link_is_meant_where_a_joint_has_its_name():
    robot = robot_named("z1")
    names = [frame.name for frame in robot.model.frames]
    assert names.count("gripperStator") == 2
    assert robot.frame("gripperStator").type == pin.FrameType.BODY
    assert robot.frame("joint1").type == pin.FrameType.JOINT
    with pytest.raises(SpecError, match="no frame 'x'"):
        robot.frame("x")


def test_an_unknown_frame_names_the_tip_and_the_nearest_names_first():
    with pytest.raises(SpecError, match=r"no frame 'link7' .* the tip is 'panda_hand_tcp'.*first: panda_link7, panda_"):
        robot_named("panda").frame("link7")


def test_panda_has_its_fingers_locked():
    robot = Robot.from_library("panda")
    assert robot.nv == 7
    assert robot.locked == {"panda_finger_joint1": 0.0, "panda_finger_joint2": 0.0}
    assert robot.joint_names == tuple(f"panda_joint{i}" for i in range(1, 8))
    assert robot.tip == "panda_hand_tcp"
    assert Robot.from_library("panda", lock={"panda_joint7": 0.5}).nv == 6  # the fingers stay locked


def test_lock_keeps_the_link_where_it_is():
    path, _ = library_urdf("ur5")
    whole, locked = Robot.from_urdf(path), Robot.from_urdf(path, lock={"elbow_joint": 0.7})
    assert (locked.nv, locked.tip) == (5, whole.tip)
    assert "elbow_joint" not in locked.joint_names
    q = np.linspace(-1, 1, 5)

    def tip(robot, q):
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, q)
        return data.oMf[robot.model.getFrameId(robot.tip)]

    assert tip(locked, q).isApprox(tip(whole, np.insert(q, 2, 0.7)), 1e-12)


@pytest.mark.parametrize("joints", [["wrist_3_joint"], ["wrist_2_joint", "wrist_3_joint"]])
def test_tip_stays_behind_locked_joints(joints):
    robot = Robot.from_library("ur5", lock=dict.fromkeys(joints, 0.1))
    assert robot.tip == Robot.from_library("ur5").tip


def test_lock_of_a_continuous_joint():
    robot = Robot.from_library("kinova", lock={"j2s6s200_joint_1": 0.5})
    assert robot.nv == 5


def test_bad_locks():
    with pytest.raises(SpecError, match=r"cannot lock 'thumb': .* has joints shoulder_pan_joint, "):
        Robot.from_library("ur5", lock={"thumb": 0.0})
    with pytest.raises(SpecError, match="cannot lock 'elbow_joint' at nan"):
        Robot.from_library("ur5", lock={"elbow_joint": np.nan})


def test_locking_all_joints_leaves_no_arm(file):
    with pytest.raises(UrdfError, match="no moving joint"):
        Robot.from_urdf(file(two_links()), lock={"shoulder": 0.0})


def test_overrides():
    path, _ = library_urdf("ur5")
    each = np.arange(1.0, 7.0)
    robot = Robot.from_urdf(path, effort_limit=each, velocity_limit=2.0, armature=0.1)
    assert np.array_equal(robot.limits.effort_upper, each)
    assert np.array_equal(robot.limits.effort_lower, -each)
    assert np.array_equal(robot.limits.velocity, np.full(6, 2.0))
    assert np.array_equal(robot.model.armature, np.full(6, 0.1))
    own = Robot.from_urdf(path)
    assert np.array_equal(own.model.armature, np.zeros(6))
    assert np.array_equal(own.limits.effort_upper, [150, 150, 150, 28, 28, 28])
    assert np.all(np.isinf(Robot.from_urdf(path, velocity_limit=np.inf).limits.velocity))


@pytest.mark.parametrize("number", [100, 100.0, np.float64(100)])
def test_one_number_that_raises_a_files_limits_is_warned_of_once(number, recwarn):
    """Only the command line warned."""
    warnings.simplefilter("always")
    robot = Robot.from_urdf(library_urdf("ur5")[0], effort_limit=number)
    said = "`effort_limit` 100 raises the file's limits of wrist_1_joint from 28, wrist_2_joint from 28, wrist_3_joint"
    assert [str(one.message).startswith(said) for one in recwarn] == [True]
    assert robot.with_payload(Payload(mass=1.0)).limits.effort_upper.tolist() == [100] * 6
    assert len(recwarn) == 1
    robot.with_limits(None, 9)
    assert str(recwarn[-1].message).startswith("`velocity_limit` 9 raises") and len(recwarn) == 2


@pytest.mark.parametrize("limit", [20, {"wrist_1_joint": 100}, [150, 150, 150, 100, 100, 100], np.inf])
def test_other_limits_are_meant(limit):
    Robot.from_urdf(library_urdf("ur5")[0], effort_limit=limit)
    Robot.from_spec(ArmSpec.paper("rr"), effort_limit=100.0)


@pytest.mark.parametrize("option", ["effort_limit", "velocity_limit", "armature"])
@pytest.mark.parametrize(
    ("value", "words"),
    [([1.0, 2.0], "shape (2,)"), (np.nan, "nan"), (-1.0, "not negative"), ([[1.0]], "shape (1, 1)")],
)
def test_bad_overrides(option, value, words):
    with pytest.raises(SpecError, match=option) as caught:
        Robot.from_library("ur5", **{option: value})
    assert words in str(caught.value)


def test_a_rotor_behind_a_gear_is_armature():
    robot = Robot.from_library("ur5", rotor_inertia=[1e-4] * 5 + [2e-4], gear_ratio=100.0)
    assert np.allclose(robot.model.armature, [1.0] * 5 + [2.0], rtol=1e-15)
    both = {"rotor_inertia": 1e-4, "gear_ratio": 100.0}
    for wrong in ({"rotor_inertia": 1e-4}, {"gear_ratio": 100.0}, both | {"armature": 1.0}):
        with pytest.raises(SpecError, match="give `armature`, or `rotor_inertia` and `gear_ratio`: armature"):
            robot.with_armature(**{"armature": None} | wrong)
    with pytest.raises(SpecError, match=r"gear_ratio of joint 'shoulder_pan_joint' is -1.0 .index 0.; it must"):
        robot.with_armature(None, 1.0, -1.0)


def test_infinite_armature_is_refused():
    with pytest.raises(SpecError, match="finite"):
        Robot.from_library("ur5", armature=np.inf)


def test_unknown_robot():
    with pytest.raises(UnknownRobotError) as caught:
        Robot.from_library("r2d2")
    assert caught.value.name == "r2d2"
    assert "panda" in caught.value.known
    assert str(caught.value).startswith("no robot named 'r2d2'; known: ")


def test_continuous_joints_have_one_coordinate():
    robot = robot_named("kinova")
    assert (robot.nv, robot.model.nq) == (6, 9)
    q = np.linspace(-3, 3, 6)
    full = robot.configuration(q)
    assert full.shape == (9,)
    assert np.array_equal(full[:2], [np.cos(q[0]), np.sin(q[0])])
    assert pin.isNormalized(robot.model, full, 1e-12)
    unbounded = [i for i, one in enumerate(list(robot.model.joints)[1:]) if one.nq == 2]
    assert unbounded == [0, 3, 5]
    assert np.all(np.isinf(robot.limits.position_upper[unbounded]))
    assert np.all(np.isinf(robot.limits.position_lower[unbounded]))
    assert np.all(np.isfinite(np.delete(robot.limits.position_upper, unbounded)))


def test_configuration_of_bounded_joints_is_q():
    assert np.array_equal(robot_named("rr").configuration([0.1, 0.2]), [0.1, 0.2])


def test_missing_limits_are_infinite(file):
    robot = Robot.from_urdf(file(two_links(joint=joint("j", "base", "arm", "continuous", ""))))
    for limit in (robot.limits.velocity, robot.limits.effort_upper, -robot.limits.effort_lower):
        assert np.array_equal(limit, [np.inf])


def test_prismatic_arm(file):
    robot = Robot.from_urdf(file(two_links(joint=joint("slide", "base", "arm", "prismatic"))))
    assert (robot.nv, robot.limits.position_upper[0]) == (1, 1.0)


def test_locked_fingers_of_a_whole_hand_do_not_make_the_tip(file):
    text = urdf(
        '<link name="base"/>',
        link("arm"),
        link("finger"),
        link("palm"),
        joint("a", "base", "arm"),
        joint("b", "arm", "finger"),
        joint("c", "arm", "palm", "fixed", ""),
    )
    assert Robot.from_urdf(file(text), lock={"b": 0.0}).tip == "palm"
    assert Robot.from_urdf(file(text)).tip == "finger"


def test_locked_fingers_side_by_side_end_the_way_to_the_tip(file):
    text = urdf(
        '<link name="base"/>',
        *(link(name) for name in ("arm", "wrist", "palm", "left", "right")),
        joint("a", "base", "arm"),
        joint("w", "arm", "wrist"),
        joint("p", "wrist", "palm", "fixed", ""),
        joint("l", "palm", "left", "prismatic"),
        joint("r", "palm", "right", "prismatic"),
    )
    gripper = {"l": 0.04, "r": 0.04}
    assert Robot.from_urdf(file(text), lock=gripper).tip == "palm"
    assert Robot.from_urdf(file(text), lock={**gripper, "w": 0.0}).tip == "palm"  # a locked wrist is part of the arm


def test_library_robot_described_by_sdf():
    with pytest.raises(UrdfError, match="SDF"):
        library_urdf("cassie")
