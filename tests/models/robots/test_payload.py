"""A payload on any frame, against Pinocchio's model with a body appended by hand."""

import numpy as np
import pinocchio as pin
import pytest

from armdyn.dynamics import Dynamics
from armdyn.errors import SpecError
from armdyn.models import Payload, Robot
from oracles import assert_close, random_states, robot_named

MOMENTS = np.array([[3e-3, 2e-4, -1e-4], [2e-4, 4e-3, 3e-4], [-1e-4, 3e-4, 5e-3]])
COM = (0.02, -0.03, 0.1)


@pytest.mark.parametrize(
    ("name", "frame"),
    [
        ("ur5", "ee_link"),  # behind a fixed joint
        ("ur5", "tool0"),  # a link without mass
        ("ur5", "forearm_link"),  # in the middle
        ("ur5", "elbow_joint"),  # a joint's own frame
        ("kinova", "j2s6s200_link_3"),  # behind a continuous joint
        ("panda", "panda_leftfinger"),  # behind a locked joint
        ("panda", "panda_link8"),  # between arm and hand
    ],
)
def test_any_frame_that_moves(name, frame):
    payload = Payload(mass=1.5, com=COM, inertia=MOMENTS, frame=frame)
    bare = robot_named(name)
    model = bare.model.copy()
    place = bare.frame(frame)
    at = pin.SE3.Identity() if frame == "elbow_joint" else _placement(bare, frame)
    model.appendBodyToJoint(place.parentJoint, pin.Inertia(1.5, np.array(COM), MOMENTS), at)
    loaded = Robot.from_library(name, payload)
    dynamics, data = Dynamics(loaded), model.createData()
    for q, v, tau in random_states(bare.nv, count=3):
        # The promised accuracy of the dynamics.
        assert_close(dynamics.aba(q, v, tau), pin.aba(model, data, bare.configuration(q), v, tau), 1e-10)


def _placement(robot, frame):
    """Of a frame in its joint's, by forward kinematics."""
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, robot.configuration(np.zeros(robot.nv)))
    place = data.oMf[robot.model.getFrameId(frame)]
    return data.oMi[robot.frame(frame).parentJoint].inverse() * place


@pytest.mark.parametrize(("frame", "what"), [("base_link", "does not move"), ("gripper", "no frame 'gripper'")])
def test_a_payload_on_a_fixed_or_unknown_frame_is_refused(frame, what):
    with pytest.raises(SpecError, match=what):
        Robot.from_library("ur5", Payload(mass=1.0, frame=frame))
