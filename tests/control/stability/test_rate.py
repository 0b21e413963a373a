"""The slowest stable rate, and the message for loops that are unstable as sampled."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from armdyn.control.laws.lqr import Lqr
from armdyn.control.laws.pid import Pid, PidGains
from armdyn.control.loop.loop import Loop
from armdyn.control.stability.rate import sampled_stability, slowest_stable_rate
from armdyn.control.stability.sampled import sampled_loop
from armdyn.errors import ProblemError
from pid_loops import example
from problems import cart

PAPER = PidGains(30, 50, 10)
TORQUE = Pid(PAPER, "torque")


def radius_at(name, rate, loop, controller=TORQUE):
    robot, poses = example(name, grams=100.6)
    return sampled_loop(robot, poses["q_goal"], controller, replace(loop, rate=rate)).radius


@pytest.mark.parametrize(("name", "radius", "kilohertz"), [("RR Ex5", 5.7, 5), ("RRR Ex6", 17.9, 10)])
def test_the_papers_gains_at_1_khz(name, radius, kilohertz):
    """An independent prototype's radii: exact velocity, no delay; and the rates of its coarse list that are stable."""
    ideal = Loop(delay=0, velocity="exact")
    assert radius_at(name, 1000.0, ideal) == pytest.approx(radius, abs=0.05)  # two digits
    assert radius_at(name, 1e3 * kilohertz, ideal) < 1
    assert radius_at(name, 2e3 * kilohertz, replace(ideal, delay=1)) < 1  # 0.1 and 0.05 ms with a tick of delay
    assert radius_at(name, 1e3 * kilohertz, replace(ideal, delay=1)) > 1


@pytest.mark.parametrize("name", ["R Ex4", "RR Ex5", "RRR Ex6"])
@pytest.mark.parametrize("velocity", ["filtered", "exact", "observer"])
@pytest.mark.parametrize("delay", [0, 1])
def test_the_rate_is_a_boundary(name, velocity, delay):
    robot, poses = example(name, grams=100.6)
    loop = Loop(velocity=velocity, delay=delay)
    rate = slowest_stable_rate(robot, poses["q_goal"], TORQUE, delay, loop=loop)
    assert radius_at(name, rate, loop) < 1 < radius_at(name, rate * (1 - 2e-4), loop)
    assert all(radius_at(name, above, loop) < 1 for above in np.geomspace(rate, 2e5, 25))


def test_the_rate_of_a_double_integrator_in_closed_form():
    """By Jury's condition at z = -1, 4 - 2 h kd > 0, for any kp."""
    gains = PidGains(1.0, 0.0, 100.0)
    rate = slowest_stable_rate(cart(), [0.0], Pid(gains, "torque"), 0, loop=Loop(velocity="exact"))
    assert rate == pytest.approx(50.0, rel=2e-4)


def test_ends_of_the_scan():
    robot, poses = example("R Ex4", grams=100.6)
    exact = Loop(velocity="exact")
    assert slowest_stable_rate(robot, poses["q_goal"], Lqr(), loop=exact, rates=(100.0, 1e4)) == 100.0
    assert slowest_stable_rate(robot, poses["q_goal"], TORQUE, loop=exact, rates=(10.0, 100.0)) is None


@dataclass(frozen=True)
class OnlyBelow:
    """A controller without a law for fast loops."""

    rate: float

    def law(self, robot, ticks, loop):
        if loop.rate > self.rate:
            raise ProblemError("too fast")
        return TORQUE.law(robot, ticks, loop)


def test_a_rate_without_a_law_is_not_stable():
    robot, poses = example("R Ex4", grams=100.6)
    assert slowest_stable_rate(robot, poses["q_goal"], OnlyBelow(2e3), rates=(500.0, 3e3)) is None
    whole = slowest_stable_rate(robot, poses["q_goal"], OnlyBelow(2e3), rates=(500.0, 2e3))
    assert whole == pytest.approx(923.0, rel=1e-3)
    with pytest.raises(ProblemError, match="too fast"):
        slowest_stable_rate(robot, poses["q_goal"], OnlyBelow(500.0))


def test_unstable_for_its_sampling():
    robot, poses = example("RR Ex5", grams=100.6)
    found = sampled_stability(robot, poses["q_goal"], TORQUE, Loop())
    assert not found.stable
    assert found.radius == sampled_loop(robot, poses["q_goal"], TORQUE, Loop()).radius > 1.5
    assert found.continuous_growth < 0
    assert found.slowest_stable_rate == slowest_stable_rate(robot, poses["q_goal"], TORQUE)
    assert found.message == (
        "unstable for its sampling: stable as a continuous loop (max Re λ = -1.5 1/s), spectral radius 1.701 at 1000 "
        "Hz with 1 tick of delay; stable from 10056 Hz on"
    )


def test_unstable_at_any_rate():
    """The paper's acceleration form of RRR."""
    robot, poses = example("RRR Ex6", grams=100.6)
    controller = Pid(PAPER, "acceleration", feedforward=False)
    found = sampled_stability(robot, poses["q_goal"], controller, Loop(delay=0))
    assert not found.stable
    assert found.slowest_stable_rate is None
    assert found.continuous_growth == pytest.approx(1.303, abs=1e-3)  # of simulate_pid's message
    assert found.message.startswith("unstable even as a continuous loop (max Re λ = +1.303 1/s); spectral radius 1.00")
    assert found.message.endswith("at 1000 Hz with no tick of delay")


def test_stable():
    robot, poses = example("RRR Ex6", grams=100.6)
    found = sampled_stability(robot, poses["q_goal"], Lqr(), Loop())
    assert found.stable
    assert found.slowest_stable_rate is None
    assert found.radius < 1
    assert found.message.startswith("stable as sampled: spectral radius 0.99")


@pytest.mark.parametrize(("name", "stable"), [("R Ex4", True), ("RRR Ex6", False)])
def test_a_continuous_loop(name, stable):
    robot, poses = example(name, grams=100.6)
    found = sampled_stability(robot, poses["q_goal"], Pid(PAPER, "acceleration", feedforward=False), Loop.ideal())
    assert found.stable == stable == (found.radius < 1) == (found.continuous_growth < 0)
    assert ("unstable" in found.message) == (not stable)


def test_coulomb_friction_does_not_make_a_loop_stable():
    """Its slope at rest would: but a joint that moves faster than the friction's width does not feel it."""
    robot, poses = example("RR Ex5", grams=100.6)
    goal, controller = poses["q_goal"], Pid(PidGains(30, 50, 0.05), "torque")
    rubbing = robot.with_friction(0.0, 0.06, 0.05)
    assert sampled_loop(robot, goal, controller, Loop(), rubbing).radius < 1
    found = sampled_stability(robot, goal, controller, Loop(), rubbing)
    assert not found.stable
    assert found.radius == sampled_loop(robot, goal, controller, Loop()).radius
    # Viscous friction stays.
    assert sampled_stability(robot, goal, controller, Loop(), robot.with_friction(1.0, 0.0)).stable


@pytest.mark.parametrize("loop", [Loop(), Loop(velocity="observer", delay=0), Loop.ideal()])
@pytest.mark.parametrize("gain", [1e30, 1e100, 1e200, 1e308])
def test_absurd_gains_are_unstable_and_no_error(gain, loop):
    """A simulator tests this for loops that have diverged."""
    robot, poses = example("RR Ex5", grams=100.6)
    controller = Pid(PidGains(0, gain, gain), "computed_torque")  # s³ + kd s² + ki has two roots to the right
    found = sampled_stability(robot, poses["q_goal"], controller, loop)
    assert not found.stable
    assert found.radius >= 1
    assert "unstable" in found.message


def test_bad_input():
    robot, poses = example("R Ex4")
    with pytest.raises(ProblemError, match="the least comes first"):
        slowest_stable_rate(robot, poses["q_goal"], TORQUE, rates=(100.0, 10.0))
    with pytest.raises(ProblemError, match="delay is -1"):
        slowest_stable_rate(robot, poses["q_goal"], TORQUE, -1)
    with pytest.raises(ProblemError, match="continuous"):
        slowest_stable_rate(robot, poses["q_goal"], TORQUE, 0, loop=Loop.ideal())
    with pytest.raises(ProblemError, match="kp has 3"):
        sampled_stability(robot, poses["q_goal"], Pid(PidGains([1, 2, 3], 1, 1)), Loop())
