"""Robots with measured inertias instead of their file's."""

import numpy as np
import pytest

from armdyn.errors import SpecError
from armdyn.models import Payload
from oracles import robot_named


@pytest.mark.parametrize("name", ["rrr", "panda"])
def test_payload_and_inertias_do_not_disturb_each_other(name):
    robot = robot_named(name)
    own = {joint: robot.model.inertias[k].toDynamicParameters() for k, joint in enumerate(robot.joint_names, start=1)}
    loaded = robot.with_payload(Payload(mass=0.1))
    assert loaded.with_inertias(own).model_hash == loaded.model_hash
    heavier = loaded.with_inertias({robot.joint_names[-1]: 2 * own[robot.joint_names[-1]]})
    body = heavier.with_payload(None).model.inertias[robot.nv]
    np.testing.assert_allclose(body.toDynamicParameters(), 2 * own[robot.joint_names[-1]])
    assert heavier.with_inertias(None).model_hash == loaded.model_hash


@pytest.mark.parametrize(
    ("inertias", "message"),
    [
        ({"joint9": np.ones(10)}, "no joint 'joint9'"),
        ({"joint1": [1.0, 2.0]}, "must be ten finite numbers"),
        ({"joint1": [1, 9, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}, "no body has such an inertia"),
        ({"joint1": [-1, 0, 0, 0, 0.1, 0, 0.1, 0, 0, 0.1]}, "no body has such an inertia"),
    ],
)
def test_a_wrong_inertia_is_refused(inertias, message):
    with pytest.raises(SpecError, match=message):
        robot_named("rrr").with_inertias(inertias)
