"""Doubts about numbers of an arm: one for each wrong number, none on good arms."""

import re

import pytest

from armdyn.models import ArmSpec, Robot
from armdyn.models.robots.plausibility import doubts
from oracles import joint, link, robot_named, urdf

MASSES = {"column": (3, 0.1, (0.02, 0.02, 0.012)), "upper": (2.2, 0.17, (0.03, 0.03, 0.003))}
MASSES |= {"fore": (1.4, 0.14, (0.015, 0.015, 0.002))}


def arm(effort=80, velocity=2.5, factor=1.0, without=(), **other):
    """An upright arm of three links; factor: of all inertias; other: tensors of links."""
    links, joints, below = [link("base", "")], [], "base"
    for name, (mass, com, moments) in MASSES.items():
        xx, yy, zz = (factor * x for x in other.get(name, moments))
        tensor = f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/>'
        own = f'<inertial><origin xyz="0 0 {com}"/><mass value="{mass}"/>{tensor}</inertial>'
        links.append(link(name, "" if name in without else own))
        axis = "0 0 1" if name == "column" else "0 1 0"
        limit = f'<limit lower="-2" upper="2" effort="{effort}" velocity="{velocity}"/>'
        joints.append(joint(f"to_{name}", below, name, inside=f'<origin xyz="0 0 0.3"/><axis xyz="{axis}"/>{limit}'))
        below = name
    return Robot.from_urdf_string(urdf(*links, *joints))


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        (arm(), []),
        (arm(factor=1e6), ["column: 3 kg with 2e+04 kg m²", "upper: 2.2 kg", "fore: 1.4 kg"]),
        (arm(fore=(15, 15, 2)), ["fore: 1.4 kg with 15 kg m² have a radius of gyration of 3.27 m"]),
        (arm(1000), ["all joints have the torque limit 1000 N m"]),
        (arm(2000, 100), ["all joints have the torque limit 2000 N m", "all joints have the velocity limit 100 rad/s"]),
        (arm(8), ["to_upper: 9.71 N m to be held at to_upper 90°, its limit is 8 N m"]),
        (arm(without=("upper",)), ["without mass, which is right of axes alone, and torques leave them out: upper"]),
        (arm(without=("upper", "fore")), ["without mass, so that torques are unknown: upper, fore."]),
        (arm(without=tuple(MASSES)), ["without mass, so that torques are unknown: column, upper, fore."]),
        (arm(without=tuple(MASSES)).with_armature(0.1), ["without mass, which is right of axes alone"]),
    ],
)
def test_each_wrong_number_is_named_once(robot, words):
    found = doubts(robot)
    assert len(found) == len(words) and all(said.startswith(own) for said, own in zip(found, words, strict=True)), found


@pytest.mark.parametrize("name", ["ur5", "panda", "z1", "kinova", "xarm7", "tiago_no_hand_arm", "rr"])
def test_good_arms_give_no_doubts(name):
    """Arms of the library, on which the thresholds were chosen, and one of the paper."""
    assert doubts(Robot.from_spec(ArmSpec.paper("rr")) if name == "rr" else robot_named(name)) == []


def test_few_of_many_weak_joints_are_named():
    arms = [link("base", "")], []
    for i in range(20):
        own = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
        arms[0].append(link(f"l{i}", own))
        limit = '<limit lower="-2" upper="2" effort="0.3" velocity="3"/>'
        inside = f'<origin xyz="0 0 0.2"/><axis xyz="0 {i % 2} {1 - i % 2}"/>{limit}'
        arms[1].append(joint(f"j{i}", f"l{i - 1}" if i else "base", f"l{i}", inside=inside))
    found = doubts(Robot.from_urdf_string(urdf(*arms[0], *arms[1])))
    assert len(found) == 8 and found[-1].startswith("and ") and all(len(said) < 300 for said in found)


def test_friction_holds_an_arm():
    (said,) = doubts(arm(8))
    needed = float(re.search(r"([\d.]+) N m to be", said)[1])
    assert doubts(arm(8).with_friction(friction=needed)) == []
