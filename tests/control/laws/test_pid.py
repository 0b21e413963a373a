import numpy as np
import pytest

import armdyn as ad
import plain_loop
from armdyn.control.laws.pid import FORMS
from armdyn.control.loop.references import Ticks
from armdyn.errors import ProblemError
from oracles import PinDynamics, random_states
from problems import paper_arm

GAINS = ad.PidGains((30.0, 20.0, 4.0), (50.0, 10.0, 1.0), (10.0, 3.0, 0.2))
ROBOT = paper_arm("rrr").with_friction(0.003, 0.06, 0.05)
GOAL = np.array([0.3, -0.2, 0.5])
MOTION = ad.ramp(ROBOT, [-1.0, 0.5, 0.1], GOAL, 0.2)


def law_of(controller, loop=None, motion=MOTION, robot=ROBOT):
    loop = loop or ad.Loop()
    return controller.law(robot, Ticks.of(robot, motion, loop.rate), loop)


def effort(law, k, q, v, integral, pending=()):
    row = law.rows[min(k, len(law.rows) - 1)]
    return np.array(law.function(q, v, integral, np.asarray(pending), row)).ravel()


@pytest.mark.parametrize("form", FORMS)
def test_at_a_set_point_it_is_the_papers_law(form):
    law = law_of(ad.Pid(GAINS, form, feedforward=False), ad.Loop.ideal(), ad.set_point(ROBOT, GOAL))
    kp, ki, kd = GAINS.per_joint(3)
    pin, friction = PinDynamics(ROBOT), ROBOT.friction
    for q, v, integral in random_states(3):
        u = kp * (GOAL - q) + ki * integral - kd * v
        expected = u if form == "torque" else pin.crba(q) @ u
        expected = expected + (pin.nle(q, v) + friction.torque(v) if form == "computed_torque" else 0)
        # Two implementations of the same sums: rounding, times gains and speeds.
        assert effort(law, 5, q, v, integral) == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("loop", [ad.Loop(), ad.Loop(delay=3, velocity="exact"), ad.Loop(velocity="observer")])
@pytest.mark.parametrize(("form", "gravity"), [(f, g) for f in FORMS for g in (False, True) if (f, g) != (FORMS[2], 1)])
def test_an_arm_that_follows_exactly_gets_the_references_torque(form, gravity, loop):
    law = law_of(ad.Pid(GAINS, form, gravity=gravity), loop)
    ticks = Ticks.of(ROBOT, MOTION, loop.rate)
    shown = plain_loop.Filtered(loop, ticks.q[0], ticks.v[0])
    for k, (q, v) in enumerate(zip(ticks.q, ticks.v, strict=True)):
        seen = shown.read(q, None)[1] if loop.velocity == "filtered" else v
        tau = effort(law, k, q, seen, np.zeros(3), np.zeros(3 * loop.delay))
        assert tau == pytest.approx(ticks.ahead(loop.delay)[k], abs=1e-9)  # torques to 20 N m, rounded


def test_gravity_is_that_of_the_readings():
    with_it, without = (law_of(ad.Pid(GAINS, gravity=g)) for g in (True, False))
    pin = PinDynamics(ROBOT)
    ticks = Ticks.of(ROBOT, MOTION, 1000.0)
    for k, (q, v, integral) in enumerate(random_states(3, seed=3)):
        more = effort(with_it, k, q, v, integral, np.zeros(3)) - effort(without, k, q, v, integral, np.zeros(3))
        assert more == pytest.approx(pin.gravity(q) - pin.gravity(ticks.q[k]), abs=1e-12)


def test_other_gains_and_motions_are_the_same_function():
    one, other = law_of(ad.Pid(GAINS)), law_of(ad.Pid(), motion=ad.set_point(ROBOT, -GOAL))
    assert one.function.serialize() == other.function.serialize()
    assert not np.array_equal(one.rows[-1], other.rows[-1])


def test_how_much_an_integral_does():
    for form in FORMS:
        law = law_of(ad.Pid(GAINS, form))
        more = [
            effort(law, 999, GOAL, np.zeros(3), unit, np.zeros(3))[i]
            - effort(law, 999, GOAL, np.zeros(3), np.zeros(3), np.zeros(3))[i]
            for i, unit in enumerate(np.eye(3))
        ]
        assert law.integral_gain == pytest.approx(more, rel=1e-9)


@pytest.mark.parametrize("arm", ["rr", "rrr"])
def test_feedforward_alone_lands(arm):
    # Error of a mean torque per tick against the jumps of a bang-bang motion within one: 3e-4 rad on RR, and on RRR,
    # whose speeds are higher, six times that.
    robot, motion = paper_arm(arm), plain_loop.paper_reference(arm, 0.1)
    run = plain_loop.simulate(robot, robot, motion, ad.Pid(ad.PidGains(0, 0, 0)), ad.Loop(), motion.duration)
    assert np.abs(run.q[-1] - motion.q[-1]).max() < {"rr": 1e-3, "rrr": 4e-3}[arm]


def test_refusals():
    with pytest.raises(ad.ArmdynError, match="gravity"):
        ad.Pid(GAINS, "computed_torque", gravity=True)
    with pytest.raises(ad.ArmdynError, match="form"):
        ad.Pid(GAINS, "velocity")
    with pytest.raises(ad.ArmdynError, match="gains"):
        ad.Pid(30.0)
    with pytest.raises(ad.ArmdynError, match="feedforward"):
        ad.Pid(GAINS, feedforward=1)
    with pytest.raises(ad.ArmdynError, match="3 numbers; expected one, or 2"):
        robot = paper_arm("rr")
        law_of(ad.Pid(GAINS), motion=ad.set_point(robot, [0, 0]), robot=robot)
    with pytest.raises(ad.ArmdynError, match="motor at every joint"):
        robot = ad.Robot.from_library("acrobot")
        law_of(ad.Pid(), motion=ad.set_point(robot, [0, 0]), robot=robot)


def test_three_numbers_are_gains():
    assert ad.Pid(60, 100, 12) == ad.Pid(ad.PidGains(60, 100, 12))
    assert ad.Pid((60, 50), (1, 2), (3, 4), gravity=True) == ad.Pid(ad.PidGains((60, 50), (1, 2), (3, 4)), gravity=True)
    for wrong in ((60,), (60, 100), (60, "torque", False)):
        with pytest.raises(ProblemError, match=r"gains is 60; .* or Pid\(kp, ki, kd\)"):
            ad.Pid(*wrong)
    with pytest.raises(ProblemError, match="kd is -1"):
        ad.Pid(60, 100, -1)
