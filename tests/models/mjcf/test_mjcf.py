"""Robots from MJCF: the same arm as from elsewhere, and refusals with element and reason."""

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import SpecError, UnsupportedJointError, UrdfError
from models.mjcf.arms import RR, mjcf, one, two
from oracles import random_states

READ = ad.Robot.from_mjcf_string


def test_the_same_arm_as_its_urdf(tmp_path):
    file = tmp_path / "rr.xml"
    file.write_text(RR)
    robot, same = ad.Robot.from_mjcf(file), ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    dynamics, expected = ad.Dynamics(robot), ad.Dynamics(same)
    for q, v, a in random_states(2):
        # The same numbers, in another order of additions.
        np.testing.assert_allclose(dynamics.rnea(q, v, a), expected.rnea(q, v, a), atol=1e-12)
    for name, own in robot.limits.rows.items():
        wanted = np.full(2, np.inf) if name == "velocity" else getattr(same.limits, name)
        np.testing.assert_array_equal(own, wanted, err_msg=name)
    assert (robot.name, robot.source, robot.tip, robot.joint_names) == ("rr", str(file), "tip", ("joint1", "joint2"))
    q = np.array([0.4, -0.9])
    np.testing.assert_allclose(dynamics.frame_placement(q, "tip")[1], expected.frame_placement(q, "tip")[1], atol=1e-15)


def test_its_payload_is_in_its_hash():
    bare, loaded = READ(RR), READ(RR, ad.Payload(mass=0.1))
    assert bare.model_hash != loaded.model_hash == READ(RR, ad.Payload(mass=0.1)).model_hash
    same = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), ad.Payload(mass=0.1))
    q, v, a = next(random_states(2))
    # The payload's stand-in for a point's inertia, 1e-12 kg m², is the same in both.
    np.testing.assert_allclose(ad.Dynamics(loaded).rnea(q, v, a), ad.Dynamics(same).rnea(q, v, a), atol=1e-12)


TURNED = (0.9, 0.1, -0.3, 0.2)


@pytest.mark.parametrize("factor", [1.0, 3.0])
@pytest.mark.parametrize("way", ["quat", "axisangle", "xyaxes", "euler", "zaxis"])
def test_every_way_of_being_turned(way, factor):
    """Axes need not be of length 1."""
    rotation = pin.Quaternion(*TURNED).normalized().matrix()
    if way == "quat":
        numbers = factor * np.array(TURNED)
    elif way == "axisangle":
        turn = pin.AngleAxis(rotation)
        numbers = [*(factor * turn.axis), np.degrees(turn.angle)]
    elif way == "xyaxes":
        numbers = np.concatenate([factor * rotation[:, 0], 2 * rotation[:, 1] + 0.3 * rotation[:, 0]])
    elif way == "euler":  # about the fixed axes x, y, z, as `rpy`: in capitals
        numbers = np.degrees(pin.rpy.matrixToRpy(rotation))
    else:
        rotation = pin.Quaternion.FromTwoVectors(np.array([0.0, 0, 1]), rotation[:, 2]).matrix()
        numbers = factor * rotation[:, 2]
    place = f'pos="1 2 3" {way}="{" ".join(map(repr, map(float, numbers)))}"'
    model = READ(mjcf(one(place=place), compiler='eulerseq="XYZ"')).model
    np.testing.assert_allclose(model.jointPlacements[1].rotation, rotation, atol=1e-14)
    np.testing.assert_array_equal(model.jointPlacements[1].translation, [1, 2, 3])


def test_euler_angles_about_axes_that_turn_with_it():
    rotation = pin.rpy.rpyToMatrix(0.3, 0.2, 0.1)  # Rz(0.1) Ry(0.2) Rx(0.3)
    text = mjcf(one(place='euler="0.1 0.2 0.3"'), compiler='angle="radian" eulerseq="zyx"')
    np.testing.assert_allclose(READ(text).model.jointPlacements[1].rotation, rotation, atol=1e-15)


def test_opposite_to_z():
    rotation = READ(mjcf(one(place='zaxis="0 0 -2"'))).model.jointPlacements[1].rotation
    np.testing.assert_allclose(rotation, np.diag([1.0, -1, -1]), atol=1e-15)


def test_a_body_of_several_joints_moves_by_each():
    joints = '<joint name="x" type="slide" axis="1 0 0"/><joint name="t" axis="0 1 0" pos="0 0 0.1"/>'
    robot = READ(
        mjcf(one(joints, '<inertial mass="2" pos="0 0 0.5" diaginertia="1 1 1"/><site name="s" pos="0 0 1"/>'))
    )
    assert robot.joint_names == ("x", "t") and robot.tip == "b"
    where = ad.Dynamics(robot).frame_placement(np.array([0.3, np.pi / 2]), "s")[1]
    np.testing.assert_allclose(where, [0.3 + 0.9, 0.0, 0.1], atol=1e-15)  # 0.9 m from the axis, turned from z to x


def test_inertia_of_shapes():
    shapes = '<geom type="box" size="0.1 0.2 0.3" mass="6"/><geom type="sphere" size="0.1" pos="0 0 1" density="500"/>'
    shapes += '<geom type="mesh" mesh="skin" mass="0"/><geom type="plane" size="1 1 1"/>'
    body = READ(mjcf(one(inside=shapes))).model.inertias[1]
    ball = 500 * 4 / 3 * np.pi * 0.1**3
    assert body.mass == pytest.approx(6 + ball, rel=1e-14)
    assert body.lever[2] == pytest.approx(ball / (6 + ball), rel=1e-14)


def test_least_mass_and_inertia():
    inside = '<inertial mass="0.1" pos="0 0 0" fullinertia="0.2 0.1 0.2 0 0.1 0"/>'
    body = READ(mjcf(one(inside=inside), compiler='boundmass="1" boundinertia="0.15"')).model.inertias[1]
    assert body.mass == 1.0  # the moments are 0.1, 0.1 and 0.3
    np.testing.assert_allclose(np.linalg.eigvalsh(body.inertia), [0.15, 0.15, 0.3], atol=1e-15)


def test_several_trees_stand_in_one_world():
    robot = READ(mjcf(one(place='pos="0 0 1"') + one('<joint name="k" type="slide"/>', name="c", place='pos="1 0 0"')))
    assert robot.joint_names == ("j", "k")
    np.testing.assert_array_equal(robot.model.jointPlacements[1].translation, [0, 0, 1])


def test_names_that_are_not_given():
    text = mjcf(one("<joint/>", name="body2") + '<body><joint/><joint axis="1 0 0"/><geom size="1"/></body>')
    robot = READ(text)
    assert robot.joint_names == ("body2_joint", "(body 2)_joint", "(body 2)_joint1")
    assert READ(text, lock={"(body 2)_joint": 0.1}).nv == 2


def test_gravity_is_the_files():
    assert READ(mjcf(one(), '<option gravity="1 0 -3"/>')).model.gravity.linear.tolist() == [1, 0, -3]
    weightless = mjcf(one(), '<option><flag gravity="disable"/></option>')
    assert not np.any(READ(weightless).model.gravity.linear)
    assert READ(mjcf(one())).model.gravity.linear.tolist() == [0, 0, -9.81]


def test_friction_and_armature_are_the_files():
    robot = READ(mjcf(one('<joint name="j" damping="0.1" frictionloss="0.2" armature="0.3"/>')))
    assert (robot.friction.damping, robot.friction.coulomb, robot.model.armature) == (0.1, 0.2, 0.3)


def test_locked_joints():
    text = mjcf(two('<joint name="k" range="20 30"/>', 'pos="1 0 0"'))
    assert READ(text, lock={"k": 0.5}).locked == {"k": 0.5}
    assert READ(text, arm=("j", "b")).locked == {"k": pytest.approx(np.radians(20))}
    assert READ(text, arm=("k", "c")).joint_names == ("k",)
    with pytest.raises(SpecError, match=r"cannot lock 'joint11': MJCF text has joints .*; did you mean 'joint1'\?"):
        READ(RR, lock={"joint11": 0.0})
    with pytest.raises(SpecError, match="has no link, frame or joint 'nose'"):
        READ(text, arm=("j", "nose"))


def test_a_joint_and_a_body_of_one_name():
    text = mjcf(two('<joint name="j"/>', first='<joint name="b"/>', inner="j"))
    assert READ(text).joint_names == ("b", "j")
    assert READ(text, lock={"j": 0.1}).joint_names == ("b",) and READ(text, lock={"b": 0.1}).joint_names == ("j",)


def test_a_free_body_stands_where_it_is():
    free = one("<freejoint name='f'/>", name="base", place='pos="0 0 2"', inside=f'<geom size="1"/>{one()}')
    with pytest.raises(UnsupportedJointError, match="joint 'f': is free") as caught:
        READ(mjcf(free))
    assert caught.value.element == "joint 'f'"
    for robot in (READ(mjcf(free), lock={"f": 0.0}), READ(mjcf(free), arm=("j", "b"))):
        assert robot.joint_names == ("j",) and robot.model.jointPlacements[1].translation[2] == 2.0


def test_gravity_compensation_is_pointed_out():
    with pytest.warns(ad.ArmdynWarning, match="gravcomp is left out"):
        READ(mjcf(one(place='gravcomp="1"')))


COUPLED = mjcf(two()).replace("</mujoco>", '<equality><joint joint1="k" joint2="j"/></equality></mujoco>')
LOOP = mjcf(one()).replace("</mujoco>", '<equality><connect body1="b" anchor="0 0 0"/></equality></mujoco>')


def test_a_coupled_joint_can_be_locked():
    assert READ(COUPLED, lock={"k": 0.0}).joint_names == ("j",)
    assert READ(COUPLED.replace("<joint joint1", '<joint active="false" joint1')).nv == 2


@pytest.mark.parametrize(
    ("text", "kind", "element", "words"),
    [
        (mjcf(one('<joint name="j" type="ball"/>')), UnsupportedJointError, "joint 'j'", "JointModelSpherical"),
        (mjcf(one('<joint name="j" stiffness="1"/>')), UnsupportedJointError, "joint 'j'", "spring"),
        (mjcf(one('<joint name="j" ref="1"/>')), UnsupportedJointError, "joint 'j'", "ref"),
        (COUPLED, UnsupportedJointError, "joint 'k'", "coupled"),
        (LOOP, UrdfError, None, "ties b together"),
        (mjcf(one('<joint name="j" type="screw"/>')), UrdfError, "joint 'j'", "type='screw' is none of hinge"),
        (mjcf(one('<joint name="j" axis="0 0 0"/>')), UrdfError, "joint 'j'", "length should be 1"),
        (mjcf(one('<joint name="j" range="1 nan"/>')), UrdfError, "joint 'j'", "not 2 finite numbers"),
        (mjcf(one('<joint name="j" range="2 1"/>')), UrdfError, "joint 'j'", "2.0 is above 1.0"),
        (mjcf(one('<joint name="j" damping="-1"/>')), UrdfError, "joint 'j'", "must not be negative"),
        (mjcf(one('<joint name="j" class="c"/>')), UrdfError, "<joint>", "class 'c' is not defined"),
        (mjcf(one() + one('<joint name="k"/>')), UrdfError, "body 'b'", "defined twice"),
        (mjcf(one() + one(name="c")), UrdfError, "joint 'j'", "defined twice"),
        (mjcf(one(place='pos="0 0 1e10"')), UrdfError, "body 'b'", "beyond 1e"),
        (mjcf(one(place='quat="0 0 0 0"')), UrdfError, "body 'b'", "no direction"),
        (mjcf(one(place='quat="1 0 0 0" euler="1 0 0"')), UrdfError, "body 'b'", "turned by quat and by euler"),
        (mjcf(one(place='xyaxes="1 0 0 2 0 0"')), UrdfError, "body 'b'", "no direction"),
        (mjcf(one(inside='<geom type="mesh" mesh="m"/>')), UrdfError, "body 'b'", "give it an <inertial>"),
        (mjcf(one(inside='<geom type="box" size="1 1"/>')), UrdfError, "body 'b'", "needs 3 positive sizes"),
        (mjcf(one(inside="<geom/>")), UrdfError, "body 'b'", "needs 1 positive sizes"),
        (mjcf(one(inside='<geom fromto="0 0 0 0 0 1" size="1"/>')), UrdfError, "body 'b'", "is no direction"),
        (mjcf(one(inside='<inertial mass="1" pos="0 0 0"/>')), UrdfError, "body 'b'", "diaginertia or fullinertia"),
        (
            mjcf(one(inside='<inertial mass="1" pos="0 0 0" diaginertia="1 1 9"/>')),
            UrdfError, "joint 'j'", "triangle",
        ),
        (mjcf(one(inside='<frame/><geom size="1"/>')), UrdfError, "body 'b'", "has a <frame>"),
        (mjcf(one(), compiler='settotalmass="3"'), UrdfError, "<compiler>", "settotalmass"),
        (mjcf(one(), compiler='eulerseq="abc"'), UrdfError, "<compiler>", "eulerseq"),
        (mjcf(one(), compiler='coordinate="global"'), UrdfError, "<compiler>", "coordinate"),
        (mjcf(one(), compiler='inertiafromgeom="false"'), UrdfError, "body 'b'", "has no <inertial>"),
        (mjcf(one(), '<option density="1"/>'), UrdfError, "<option>", "drag"),
        (mjcf('<body name="b"/>'), UrdfError, None, "has no moving joint"),
        (mjcf(""), UrdfError, None, "has no moving joint"),
    ],
)  # fmt: skip
def test_refused_if_it_cannot_be_read(text, kind, element, words):
    with pytest.raises(kind) as caught:
        READ(text, source="arm.xml")
    assert words in str(caught.value) and caught.value.element == element
    assert caught.value.source == "arm.xml" and len(str(caught.value)) < 500


def test_a_body_without_mass_is_read_without_dynamics():
    with pytest.raises(UrdfError, match="moves no inertia") as caught:
        READ(mjcf(one(inside=""))).holding_torque([0.0])
    assert caught.value.element == "joint 'j'"


def test_a_pinocchio_without_the_parser(monkeypatch):
    monkeypatch.delattr(pin, "buildModelFromMJCF")
    with pytest.raises(UrdfError, match="was built without; give a URDF"):
        READ(RR)


def test_no_text():
    with pytest.raises(UrdfError, match="must be the text of an MJCF"):
        READ(7)
    with pytest.raises(UrdfError, match=r"use Robot\.from_mjcf_string"):
        ad.Robot.from_mjcf(RR)
    with pytest.raises(UrdfError, match=r"Robot\.from_mjcf reads it"):
        ad.Robot.from_urdf_string(RR)
