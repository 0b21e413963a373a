import numpy as np
import pytest

import armdyn as ad
import plain_loop
from armdyn.control.loop.references import Ticks
from oracles import PinDynamics, random_states
from problems import paper_arm

ROBOT = paper_arm("rrr")
GOAL = np.array([0.3, -0.2, 0.5])
MOTION = ad.ramp(ROBOT, [-1.0, 0.5, 0.1], GOAL, 0.2)


def effort(law, k, q, v, integral, pending=()):
    return np.array(law.function(q, v, integral, np.asarray(pending), law.rows[min(k, len(law.rows) - 1)])).ravel()


@pytest.mark.parametrize("loop", [ad.Loop(), ad.Loop(delay=3, velocity="exact"), ad.Loop(velocity="observer")])
def test_an_arm_that_follows_exactly_gets_the_references_torque(loop):
    ticks = Ticks.of(ROBOT, MOTION, loop.rate)
    law = ad.ComputedTorque(100.0, 0.9, 1e4).law(ROBOT, ticks, loop)
    shown = plain_loop.Filtered(loop, ticks.q[0], ticks.v[0])
    for k, (q, v) in enumerate(zip(ticks.q, ticks.v, strict=True)):
        seen = shown.read(q, None)[1] if loop.velocity == "filtered" else v
        tau = effort(law, k, q, seen, np.zeros(3), np.zeros(3 * loop.delay))
        assert tau == pytest.approx(ticks.ahead(loop.delay)[k], abs=1e-9)  # torques to 20 N m, rounded


def test_an_error_commands_its_acceleration():
    w, z, ki = 60.0, 0.8, 2e4
    loop = ad.Loop.ideal()
    ticks = Ticks.of(ROBOT, ad.set_point(ROBOT, GOAL), loop.rate)
    law = ad.ComputedTorque(w, z, ki).law(ROBOT, ticks, loop)
    pin = PinDynamics(ROBOT)
    for q, v, integral in random_states(3):
        a = w**2 * (GOAL - q) - 2 * z * w * v + ki * integral
        assert effort(law, 0, q, v, integral) == pytest.approx(pin.rnea(q, v, a), rel=1e-9)  # sums to 1e6 N m, rounded
        assert pin.aba(q, v, effort(law, 0, q, v, integral)) == pytest.approx(a, rel=1e-9)


def test_every_joint_of_the_nominal_arm_is_an_oscillator():
    # At 20 kHz without delay the loop is nearly continuous: e = e₀ (1 + ω t) exp(-ω t) with ζ = 1, to the half tick
    # that a held torque lags, 25e-6 ω of e₀.
    w, rate, far = 20.0, 20_000.0, 0.01
    loop = ad.Loop(rate=rate, delay=0, encoder=0.0, velocity="exact")
    rest = ad.set_point(ROBOT, GOAL)
    ticks = Ticks.of(ROBOT, rest, rate)
    law = ad.ComputedTorque(w).law(ROBOT, ticks, loop)
    aba = plain_loop.forward_dynamics(ROBOT)
    q, v, e0 = GOAL - far * np.array([1, -1, 0.5]), np.zeros(3), far * np.array([1, -1, 0.5])
    for k in range(2000):
        q, v = plain_loop.stepped(aba, q, v, effort(law, k, q, v, np.zeros(3)), 1 / rate, 1)
    wt = w * 2000 / rate
    assert GOAL - q == pytest.approx(e0 * (1 + wt) * np.exp(-wt), abs=25e-6 * w * far * wt)


def test_the_integral_waits_for_the_goal():
    ticks = Ticks.of(ROBOT, MOTION, 1000.0)
    law = ad.ComputedTorque(100.0, integral=1e4).law(ROBOT, ticks, ad.Loop())
    assert law.integrate_from == MOTION.duration
    assert law.integral_gain == pytest.approx(1e4 * np.diag(PinDynamics(ROBOT).crba(GOAL)), rel=1e-9)


@pytest.mark.parametrize("faulty", [{"bandwidth": 0.0}, {"damping": -1.0}, {"integral": -1.0}, {"bandwidth": np.inf}])
def test_refusals(faulty):
    with pytest.raises(ad.ArmdynError, match=next(iter(faulty))):
        ad.ComputedTorque(**faulty)


def test_a_joint_without_a_motor_is_refused():
    robot = ad.Robot.from_library("acrobot")
    with pytest.raises(ad.ArmdynError, match="motor at every joint"):
        ad.ComputedTorque().law(robot, Ticks.of(robot, ad.set_point(robot, [0, 0]), 1000.0), ad.Loop())
