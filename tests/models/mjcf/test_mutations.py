"""Property: any mutated MJCF gives a robot or an ArmdynError."""

from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import armdyn as ad
from models.mjcf.arms import RR, mjcf, one, two
from mutations import NAMES, NUMBERS, mutated

SHAPES = '<geom type="capsule" size="0.1" fromto="0 0 0 1 0 0"/><geom type="box" size="1 1 1" euler="1 2 3"/>'
TEXTS = (RR, mjcf(one(inside=SHAPES) + two('<joint name="k" type="ball"/>', first='<freejoint name="f"/>', inner="d")))


def check(text):
    try:
        robot = ad.Robot.from_mjcf_string(text)
    except ad.ArmdynError as error:
        assert str(error) and len(str(error)) < 2000
        return
    torque = pin.rnea(robot.model, robot.model.createData(), pin.neutral(robot.model), *np.ones((2, robot.nv)))
    assert np.all(np.isfinite(torque)) and robot.nv == len(robot.joint_names) >= 1
    assert robot.frame(robot.tip).name == robot.tip


@pytest.mark.slow
@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=st.sampled_from(TEXTS), choice=st.randoms(use_true_random=False))
def test_mutated(text, choice):
    root = ElementTree.fromstring(text)
    for _ in range(choice.randrange(3)):
        element = choice.choice([each for each in root.iter() if each.attrib])
        element.set(choice.choice(sorted(element.attrib)), choice.choice(NUMBERS + NAMES))
    check(mutated(ElementTree.tostring(root, encoding="unicode"), choice).decode(errors="replace"))


@pytest.mark.parametrize("name", ["universe", "world", "root_joint", "a b", "Ω"])
def test_names_that_pinocchio_has_for_itself(name):
    """pin 4.1 crashes where a joint of MJCF is called "universe"."""
    robot = ad.Robot.from_mjcf_string(mjcf(two(f'<joint name="{name}"/>')))
    assert robot.joint_names == ("j", name)
    assert ad.Robot.from_mjcf_string(mjcf(two(f'<joint name="{name}"/>')), lock={name: 0.1}).joint_names == ("j",)
