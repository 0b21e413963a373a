"""The benchmarks that come with the package: their equations of motion by hand, and their passive joints."""

import numpy as np
import pinocchio as pin
import pytest

from armdyn.errors import SpecError, UnknownRobotError
from armdyn.models import Payload, Robot
from armdyn.models.robots.library import BENCHMARKS, LIBRARY_ARMS, other_robots
from oracles import random_states
from underactuated import BY_HAND

LIMITS = {"acrobot": 8.0, "cart_pole": 20.0, "furuta_pendulum": 0.05627, "pendubot": 6.0}
"""Of the motors [N m or N], from the sources that the files name."""


def test_table_is_whole():
    assert set(BENCHMARKS) == set(LIMITS) == set(BY_HAND)
    assert list(BENCHMARKS) == sorted(BENCHMARKS)
    assert not set(BENCHMARKS) & {*LIBRARY_ARMS, *other_robots()}  # no library's robot is hidden


@pytest.mark.parametrize("name", BENCHMARKS)
def test_equations_of_motion(name):
    robot = Robot.from_library(name)
    motor = int(np.flatnonzero(~robot.limits.passive)[0])
    data, scale = robot.model.createData(), LIMITS[name]
    for q, v, u in random_states(2, count=20):
        tau = np.zeros(2)
        tau[motor] = scale * u[0]
        found = pin.aba(robot.model, data, robot.configuration(q), v, tau)
        # Inertias of points, 1e-12 kg m² for zero, show at 1e-11; of the Furuta pendulum's axis at 1e-8.
        np.testing.assert_allclose(found, BY_HAND[name](q, v, tau[motor]), rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("name", BENCHMARKS)
def test_limits(name):
    robot = Robot.from_library(name)
    assert robot.passive == BENCHMARKS[name]
    upper = dict(zip(robot.joint_names, robot.limits.effort_upper, strict=True))
    assert all(upper.pop(joint) == 0 for joint in robot.passive)
    assert list(upper.values()) == [LIMITS[name]]
    assert np.all(np.isinf(robot.limits.velocity))
    assert robot.tip == "tip" and robot.frame("tip").parentJoint == 2


def test_one_effort_limit_is_for_all_joints_that_have_a_motor():
    robot = Robot.from_library("cart_pole", effort_limit=5.0)
    assert robot.limits.effort_upper.tolist() == [5.0, 0.0]
    assert robot.with_limits(4.0, None).limits.effort_lower.tolist() == [-4.0, 0.0]
    assert robot.with_limits([7.0, 1.0], None).passive == ()  # who says so of each joint means it


def test_readers_options_are_for_them_too():
    plain, robot = Robot.from_library("acrobot"), Robot.from_library("acrobot", Payload(mass=0.5), damping=0.1)
    assert robot.payload.mass == 0.5 and robot.friction.present
    assert robot.model_hash != plain.model_hash
    single = Robot.from_library("cart_pole", lock={"pole": 0.0})
    assert single.joint_names == ("cart",) and single.passive == ()


def test_a_zero_of_a_urdf_is_no_passive_joint_by_itself():
    text = Robot.from_library("cart_pole").urdf
    robot = Robot.from_urdf_string(text)
    assert robot.passive == () and robot.limits.effort_upper.tolist() == [20.0, np.inf]
    assert robot.with_passive(["pole"]).passive == ("pole",)
    assert Robot.from_urdf_string(text, effort_limit=[20.0, 0.0]).passive == ("pole",)
    with pytest.raises(SpecError, match="passive: there is no joint 'pol'; did you mean 'pole'"):
        robot.with_passive(["pol"])


def test_names_are_known_where_one_is_mistyped():
    with pytest.raises(UnknownRobotError, match="did you mean 'cart_pole'"):
        Robot.from_library("cartpole")
