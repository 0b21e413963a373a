import subprocess
import sys
from dataclasses import replace

import pytest

from armdyn.models import ArmSpec, Payload, Robot
from armdyn.models.robots.library import library_urdf
from oracles import robot_named


def test_the_same_arm_has_the_same_hash_in_another_process():
    code = "from armdyn.models import Robot; print(Robot.from_library('panda').model_hash)"
    other = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip()
    assert other == Robot.from_library("panda").model_hash == Robot.from_library("panda").model_hash
    assert len(other) == 64


def test_the_hash_depends_on_the_dynamics():
    path, _ = library_urdf("ur5")
    arms = [
        Robot.from_urdf(path),
        Robot.from_urdf(path, payload=Payload(mass=1e-6)),
        Robot.from_urdf(path, payload=Payload(mass=1.0)),
        Robot.from_urdf(path, payload=Payload(mass=1.0, frame="forearm_link")),
        Robot.from_urdf(path, armature=1e-3),
        Robot.from_urdf(path, damping=0.1),
        Robot.from_urdf(path, friction=0.1),
        Robot.from_urdf(path, friction=0.1, friction_width=0.1),
        Robot.from_urdf(path, friction=0.1, friction_width=[0.1] * 5 + [0.2]),
        Robot.from_urdf(path, lock={"wrist_3_joint": 0.0}),
        Robot.from_urdf(path, lock={"wrist_3_joint": 0.1}),
        Robot.from_urdf(path, lock={"wrist_2_joint": 0.1}),
    ]
    assert len({arm.model_hash for arm in arms}) == len(arms)


def test_the_hash_does_not_depend_on_limits_and_unused_widths():
    path, _ = library_urdf("ur5")
    own = Robot.from_urdf(path).model_hash
    assert Robot.from_urdf(path, effort_limit=1.0, velocity_limit=2.0).model_hash == own
    one, each = (Robot.from_urdf(path, friction=0.1, friction_width=width) for width in (0.1, [0.1] * 6))
    assert one.model_hash == each.model_hash and each.friction.width == 0.1
    assert Robot.from_urdf(path, friction_width=0.5).model_hash == own  # without friction it says nothing
    assert replace(Robot.from_urdf(path), name="x", source="y").model_hash == own


@pytest.mark.parametrize("change", [1e-9, 1e-6])
def test_every_last_number_counts(change):
    links = ArmSpec.paper("rr").links
    longer = replace(ArmSpec.paper("rr"), links=(links[0], replace(links[1], com=links[1].com + change)))
    assert Robot.from_spec(longer).model_hash != robot_named("rr").model_hash
