"""Torque limits as the range in a state: constant ones, and a kind that falls with speed, which is one more class."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import SpecError
from armdyn.models.values.actuator_limits import ActuatorLimits, ConstantTorque, TorqueSpeed
from armdyn.optimal.verify.within_limits import excesses
from oracles import robot_named

LOWER, UPPER = np.array([-1.0, -4.0, 0.0]), np.array([3.0, 2.0, 0.0])
LIMITS = ConstantTorque(LOWER, UPPER)
REST = np.zeros(3)


@dataclass(frozen=True, eq=False)
class FallingTorque(ActuatorLimits):
    """Torque that falls linearly with the speed, to nothing at `top` [rad/s]."""

    top: float = 1.0

    def range(self, q, v):
        left = 1 - abs(v) / self.top if isinstance(v, np.ndarray) else 1 - ca.fabs(v) / self.top
        return left * self.lower, left * self.upper


def test_constant_limits():
    assert np.array_equal(LIMITS.width, [4, 6, 0]) and np.array_equal(LIMITS.half_range, [2, 3, 0])
    assert np.array_equal(LIMITS.center, [1, -1, 0]) and np.array_equal(LIMITS.strongest, [3, 4, 0])
    assert LIMITS.passive.tolist() == [False, False, True] and np.array_equal(LIMITS.scale, [2, 3, 2])
    tau = np.array([[4.0, -5.0, 0.0], [0.0, 0.0, 1.0]])
    assert np.array_equal(LIMITS.clip(tau, REST, REST), [[3, -4, 0], [0, 0, 0]])
    assert np.array_equal(LIMITS.excess(tau, REST, REST), [[1, 1, 0], [-1, -2, 1]])
    assert LIMITS.allows(tau, REST, REST).tolist() == [[False, False, True], [True, True, False]]
    assert np.array_equal(LIMITS.extreme(np.array([1, -1, 0])), [3, -4, 0])
    less = LIMITS.scaled(np.array([0.5, 0.75, 0.9]))
    assert np.array_equal(less.lower, [-0.5, -3, 0]) and np.array_equal(less.upper, [1.5, 1.5, 0])


def test_limits_of_joints_have_them():
    limits = robot_named("rr").limits
    assert np.array_equal(limits.actuators.upper, limits.effort_upper) and limits.actuators.constant
    weaker = replace(limits, effort_upper=[1.0, 2.0])
    assert np.array_equal(weaker.actuators.upper, [1.0, 2.0])
    with pytest.raises(SpecError, match="limits: actuators is 3; it must be an ActuatorLimits"):
        replace(limits, actuators=3)


def test_another_kind_is_one_class():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    limits = replace(robot.limits, actuators=FallingTorque(REST, REST, top=10.0))
    weaker = replace(robot, limits=limits).with_limits(2.0, None)
    kind = weaker.limits.actuators
    assert isinstance(kind, FallingTorque) and np.array_equal(kind.upper, [2.0, 2.0]) and kind.top == 10.0
    problem = ad.MinimumTimeProblem(weaker, q_start=[0.0, 0.0], q_goal=[0.1, 0.0], reserve=0.5)
    assert isinstance(problem.limits.actuators, FallingTorque)
    t, v = np.linspace(0, 1, 3), np.array([[0.0, 0.0], [5.0, 0.0], [10.0, 0.0]])
    torque, _, _ = excesses(problem.limits, ad.Trajectory(t, np.zeros((3, 2)), v, np.full((3, 2), 0.75)))
    assert np.allclose(torque.beyond, [[-0.25, -0.25], [0.25, -0.25], [0.75, -0.25]])


JOINTS = ("a", "b", "c")
CURVE = [[0.0, 2.5], [1.0, 2.0], [3.0, 0.5]]
FALLING = TorqueSpeed(LOWER, UPPER, joints=JOINTS, curves={"a": CURVE, "c": CURVE})


def test_torque_falls_with_speed_where_it_drives():
    for speed, driving in ((0.0, 2.5), (0.5, 2.25), (1.0, 2.0), (2.0, 1.25), (3.0, 0.5)):
        v = np.array([speed, speed, speed])
        lower, upper = FALLING.range(REST, v)
        assert np.allclose(upper, [driving, 2.0, 0.0]) and np.allclose(lower, [-1, -4, 0])  # -1: braking
        lower, upper = FALLING.range(REST, -v)
        assert np.allclose(lower, [-min(driving, 1.0), -4, 0]) and np.allclose(upper[1:], [2.0, 0.0])
        assert upper[0] == pytest.approx(min(3.0, 2.5 + 0.5 * speed))  # the back EMF helps
    # Beyond its last point as before; past zero torque it cannot but brake, with no more than it has.
    assert np.allclose([FALLING.range(REST, np.full(3, v))[1][0] for v in (3.5, 4.0, 9.0)], [0.125, -0.25, -1.0])
    slopes, rest = FALLING.lines
    assert np.allclose(slopes, [[0.5, 0, 0], [0.75, 0, 0]]) and np.allclose(rest[:, 0], [2.5, 2.75])
    assert np.all(np.isinf(rest[:, 1:]))  # no curve, no motor
    corner = replace(FALLING, curves={"a": [[0.0, 3.0], [1.0, 3.0], [2.0, 2.0]]})
    assert np.array_equal(np.squeeze(corner.lines), [[1, 0, 0], [4, np.inf, np.inf]])  # level: the torque limit's own
    assert not replace(FALLING, curves={"a": [[0.0, 3.0], [1.0, 3.0]]}).lines[0].size


def test_a_reserve_takes_its_part_at_every_speed():
    less = FALLING.scaled(np.array([0.8, 1.0, 1.0]))
    v = np.array([[0.5, 0, 0], [2.0, 0, 0]])
    assert np.allclose(less.range(REST, v)[1][:, 0], 0.8 * FALLING.range(REST, v)[1][:, 0])


@pytest.mark.parametrize(
    ("curve", "words"),
    [
        ([[0, 2], [1, 0.5], [2, 0.4]], "not concave: it falls more slowly beyond speed 1"),
        ([[0, 2], [1, 2.5]], "its torque rises beyond speed 0"),
        ([[1, 2], [2, 1]], "its speeds do not grow from 0"),
        ([[0, 2], [0, 1]], "its speeds do not grow from 0"),
        ([[0, 0], [1, 0]], "its torque is 0"),
        ([[0, 2], [1, -1]], "its torque is -1"),
        ([[0, np.inf], [1, 1]], "a number is not finite"),
        ([[0, 2]], "its shape is (1, 2)"),
        ("fast", "expected [speed, torque] of two or more points"),
    ],
)
def test_a_wrong_curve_is_refused(curve, words):
    with pytest.raises(SpecError, match="torque_speed of joint 'a' is ") as refused:
        TorqueSpeed(LOWER, UPPER, joints=JOINTS, curves={"a": curve})
    assert words in str(refused.value)


def test_curves_of_a_robot():
    robot = robot_named("rr").with_torque_speed({"joint2": [[0, 3], [20, 1]]})
    assert isinstance(robot.limits.actuators, TorqueSpeed) and not robot.limits.actuators.constant
    assert robot.with_limits(2.0, None).limits.actuators.range(REST[:2], np.array([0.0, 15.0]))[1].tolist() == [2, 1.5]
    assert robot.with_torque_speed({}).limits.actuators.constant
    with pytest.raises(SpecError, match="there is no joint 'joint3'; did you mean 'joint2'"):
        robot.with_torque_speed({"joint3": [[0, 3], [20, 1]]})
    with pytest.raises(SpecError, match="torque_speed is 3; it must be a Mapping: joint name"):
        ad.Robot.from_spec(ad.ArmSpec.paper("rr"), torque_speed=3)
    with pytest.raises(SpecError, match="FallingTorque has no lines"):
        FallingTorque(LOWER, UPPER).lines  # noqa: B018


def test_a_range_may_be_symbolic():
    q, v = ca.SX.sym("q", 3), ca.SX.sym("v", 3)
    for limits in (LIMITS, FALLING, FallingTorque(LOWER, UPPER, top=2.0)):
        both = ca.Function("range", [q, v], [*map(ca.SX, limits.range(q, v))])
        at = np.array([0.5, -1.0, 2.0])
        assert np.allclose(
            np.hstack([np.array(end) for end in both(at, at)]).T, np.broadcast_to(limits.range(at, at), (2, 3))
        )
