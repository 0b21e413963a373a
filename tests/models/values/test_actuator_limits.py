"""Torque limits as the range in a state: constant ones, and a kind that falls with speed, which is one more class."""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import SpecError
from armdyn.models.values.actuator_limits import ActuatorLimits, ConstantTorque
from armdyn.optimal.landing.limit_violations import excesses
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
    less = LIMITS.reserving(np.array([0.5, 0.25, 0.1]))
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


def test_a_range_may_be_symbolic():
    q, v = ca.SX.sym("q", 3), ca.SX.sym("v", 3)
    for limits in (LIMITS, FallingTorque(LOWER, UPPER, top=2.0)):
        both = ca.Function("range", [q, v], [*map(ca.SX, limits.range(q, v))])
        at = np.array([0.5, -1.0, 2.0])
        assert np.allclose(
            np.hstack([np.array(end) for end in both(at, at)]).T, np.broadcast_to(limits.range(at, at), (2, 3))
        )
