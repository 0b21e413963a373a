import time

import numpy as np
import pinocchio as pin
import pytest

from armdyn.errors import UrdfError
from oracles import LIMIT, joint, link, urdf

BAD_TENSOR = '<inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="9"/></inertial>'


TOWER = urdf(
    link("base", BAD_TENSOR), link("antenna", BAD_TENSOR), link("a"), link("b", BAD_TENSOR), link("c"),
    joint("mount", "base", "antenna", "fixed", ""), joint("i", "base", "a"), joint("j", "base", "b"),
    joint("k", "b", "c"),
)  # fmt: skip


def test_inertia_of_fixed_links_does_not_matter(read):
    with pytest.raises(UrdfError, match="triangle") as caught:
        read(TOWER)
    assert caught.value.element == "link 'b'"
    assert read(TOWER, lock={"j": 0.2}).joint_names == ("i", "k")
    assert read(TOWER, arm=("i", "a")).joint_names == ("i",)


def test_tensors_that_are_a_rounding_off_zero_are_zero(read):
    tiny = BAD_TENSOR.replace('ixx="1"', 'ixx="-3e-17"').replace('iyy="1"', 'iyy="0"').replace("9", "2e-17")
    robot = read(urdf('<link name="base"/>', link("a", f'{tiny[:10]}<origin xyz="1 0 0"/>{tiny[10:]}'),
                      joint("i", "base", "a", inside=f'<axis xyz="0 1 0"/>{LIMIT}')))  # fmt: skip
    assert pin.crba(robot.model, robot.model.createData(), np.zeros(1))[0, 0] == pytest.approx(1.0, rel=1e-12)


def test_a_joint_of_its_links_name_can_be_locked_and_keeps_its_name(read):
    text = urdf(link("base"), link("a"), link("b"), joint("a", "base", "a"), joint("b", "a", "b"))
    whole = read(text)
    assert whole.joint_names == ("a", "b") and whole.frame("a").type == pin.FrameType.BODY
    assert read(text, lock={"a": 0.3}).joint_names == ("b",)
    robot = read(text, lock={"b": 0.3})
    assert robot.joint_names == ("a",) and robot.locked == {"b": 0.3}
    assert {frame.name for frame in robot.model.frames} == {"universe", "base", "a", "b"}
    taken = urdf(link("base"), link("a"), link("a (joint)"), joint("a", "base", "a"), joint("b", "a", "a (joint)"))
    assert read(taken, lock={"b": 0.3}).joint_names == ("a",)


def test_two_joints_about_one_axis_with_nothing_between(read):
    text = urdf(link("base"), link("a", ""), link("b"), joint("i", "base", "a"), joint("j", "a", "b"))
    with pytest.raises(UrdfError, match="no inertia of its own") as caught:
        read(text).expect_dynamics()
    assert caught.value.element in ("joint 'i'", "joint 'j'")
    assert read(text, armature=1e-3).has_dynamics  # a rotor turns with each
    across = joint("j", "a", "b", inside=f'<axis xyz="1 0 1"/>{LIMIT}')
    assert read(urdf(link("base"), link("a", ""), link("b"), joint("i", "base", "a"), across)).has_dynamics


def test_only_elements_of_the_dynamics_are_read(read):
    """Visuals that Pinocchio's own reader would stop at."""
    mess = '<visual><geometry><mesh filename="package://gone/x.stl"/></geometry></visual><visual/><collision/>'
    text = urdf(
        '<link name="base"/>', link("a").replace("</link>", f"{mess}</link>"), joint("i", "base", "a"),
        '<transmission/><gazebo><x/></gazebo><material name="m"><color rgba="no colour"/></material>',
    )  # fmt: skip
    assert read(text).model == read(urdf('<link name="base"/>', link("a"), joint("i", "base", "a"))).model


@pytest.mark.parametrize("inside", ['<limit lower="1e"/>', '<axis xyz="x"/>', '<dynamics damping="-"/>', "<mimic/>"])
def test_of_a_fixed_joint_only_the_place_is_read(read, inside):
    text = urdf(
        '<link name="base"/>', link("a"), link("b"), joint("i", "base", "a"), joint("j", "a", "b", "fixed", inside)
    )
    assert read(text).joint_names == ("i",)


def test_line_ends_between_numbers(read):
    text = urdf('<link name="base"/>', link("a"), joint("i", "base", "a", inside=f'<axis xyz="0&#10;1\t0"/>{LIMIT}'))
    assert read(text).nv == 1


@pytest.mark.slow
def test_many_fixed_links_take_time_with_their_number(read):
    """990 took 28 CPU s: the way to the base was walked from each of them, frame by frame; now half a second."""
    text = urdf(link("base"), link("l0"), joint("turns", "base", "l0"), *(
        link(f"l{i}") + joint(f"fixed{i}", f"l{i - 1}", f"l{i}", "fixed", "") for i in range(1, 990)
    ))  # fmt: skip
    began = time.process_time()
    assert read(text).tip == "l989"
    assert time.process_time() - began < 5.0
