"""Margins against the loop itself, with its torque multiplied or later."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from armdyn.control.laws.computed_torque import ComputedTorque
from armdyn.control.laws.lqr import Lqr
from armdyn.control.laws.pid import Pid, PidGains
from armdyn.control.loop.loop import Loop
from armdyn.control.stability.margins import broken, frequencies, loop_margins, multiloop_disk
from armdyn.control.stability.region import GainRegion
from armdyn.control.stability.sampled import sampled_loop
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.models.values.spec import ArmSpec, Payload
from pid_loops import example

CASES = {
    "R, torque": ("R Ex4", Pid(PidGains(30, 50, 10), "torque"), Loop()),
    "R, acceleration": ("R Ex4", Pid(PidGains(30, 50, 10), "acceleration"), Loop()),
    "R, no integral": ("R Ex4", Pid(PidGains(30, 0, 1), "torque"), Loop(delay=0, velocity="exact")),
    "RR, computed torque": ("RR Ex5", Pid(PidGains(100, 200, 20), "computed_torque"), Loop()),
    "RR, lqr": ("RR Ex5", Lqr(), Loop()),
    "RRR, lqr, observer": ("RRR Ex6", Lqr(), Loop(delay=2, velocity="observer")),
}
EVERY = [pytest.param(case, marks=pytest.mark.slow) if case.startswith("RRR") else case for case in CASES]


@cache
def loop_of(case):
    name, controller, loop = CASES[case]
    robot, poses = example(name, grams=100.6)
    return sampled_loop(robot, poses["q_goal"], controller, loop)


@cache
def margins_of(case):
    return loop_margins(loop_of(case))


def times(loop, factors):
    """The loop whose arm feels each torque times a factor; the controller's memory of them stays."""
    return replace(loop, B=loop.B * factors)


@pytest.mark.parametrize("case", EVERY)
def test_gain_margins_are_where_the_radius_is_one(case):
    loop = loop_of(case)
    for one in margins_of(case):
        factors = np.ones(loop.B.shape[1])
        for end, outward in zip(one.gain, (1 - 1e-6, 1 + 1e-6), strict=True):  # the rounding of the radius
            if not 0 < end < np.inf:
                continue
            factors[one.joint] = end / outward
            assert times(loop, factors).radius < 1
            factors[one.joint] = end * outward
            assert times(loop, factors).radius > 1
        assert one.gain[0] < 1 < one.gain[1]
        for between in np.geomspace(max(one.gain[0], 1e-3) * 1.001, min(one.gain[1], 1e3) / 1.001, 30):
            factors[one.joint] = between
            assert times(loop, factors).radius < 1


def test_gravity_must_be_held_by_feedback():
    """Upright and without an integral, kp times the least factor is the gravity's slope."""
    name, controller, how = CASES["R, no integral"]
    robot, _ = example(name, grams=100.6)
    loop = sampled_loop(robot, [np.pi / 2], controller, how)
    slope = -GainRegion.of(robot, [np.pi / 2], "torque").stiffness
    assert slope > 0.3
    assert loop_margins(loop)[0].gain[0] == pytest.approx(slope / 30, rel=1e-9)


@pytest.mark.parametrize("velocity", ["filtered", "exact"])
@pytest.mark.parametrize("kd", [0.3, 0.5, 0.8])
def test_delay_margin_in_whole_ticks(kd, velocity):
    """As many ticks more as fit in it are stable, one more is not."""
    robot, poses = example("R Ex4", grams=100.6)
    controller = Pid(PidGains(10, 20, kd), "torque")
    loop = Loop(velocity=velocity, delay=1)
    one = loop_margins(sampled_loop(robot, poses["q_goal"], controller, loop))[0]
    ticks = one.delay * loop.rate
    assert 1 < ticks < 90
    assert abs(ticks - round(ticks)) > 1e-3
    for more, stable in ((int(ticks), True), (int(ticks) + 1, False)):
        later = sampled_loop(robot, poses["q_goal"], controller, replace(loop, delay=1 + more))
        assert (later.radius < 1) == stable


@pytest.mark.parametrize("case", EVERY)
def test_phase_and_disk_margins_agree_with_python_control(case):
    """Its disk margin of one broken loop; and the disk lies within the gain and phase margins."""
    import control  # takes half a second, of the one worker that runs this

    loop = loop_of(case)
    for one in margins_of(case):
        system = control.ss(*broken(loop, one.joint), 0.0, loop.period)
        disk, _, _ = control.disk_margins(system, frequencies(loop, system.A))
        assert one.disk == pytest.approx(disk, rel=1e-6)
        # Both points of the real axis and the phase of the disk lie within the margins (Seiler et al., (8)).
        assert one.gain[0] <= (2 - one.disk) / (2 + one.disk)
        assert one.gain[1] >= (2 + one.disk) / (2 - one.disk)
        assert one.phase >= 2 * np.arctan(one.disk / 2) * (1 - 1e-6)


@pytest.mark.parametrize("case", EVERY)
def test_the_disk_of_all_loops_at_once(case):
    loop, random = loop_of(case), np.random.default_rng(1)
    own, disk = margins_of(case), multiloop_disk(loop)
    assert 0 < disk <= min(one.disk for one in own) * (1 + 1e-9)
    if len(own) == 1:
        assert disk == pytest.approx(own[0].disk, rel=1e-6)
    low, high = np.log((2 - disk) / (2 + disk)), np.log((2 + disk) / (2 - disk))
    for _ in range(200):
        factors = np.exp(random.choice([low, high, *random.uniform(low, high, 2)], len(own)))
        assert times(loop, factors).radius < 1


def test_an_unstable_loop_has_no_margins():
    robot, poses = example("RR Ex5", grams=100.6)
    loop = sampled_loop(robot, poses["q_goal"], Pid(PidGains(30, 50, 10), "torque"), Loop())
    for margin in (loop_margins, multiloop_disk):
        with pytest.raises(ProblemError, match=r"unstable, with a spectral radius of 1\.7"):
            margin(loop)


@pytest.mark.slow
def test_narrow_resonances_are_met():
    """Near instability the disk margin is that of a peak between evenly spaced frequencies."""
    robot, poses = example("RR Ex5", grams=100.6)
    loop = sampled_loop(robot, poses["q_goal"], ComputedTorque(bandwidth=120.0, damping=0.1018), Loop())
    assert 0.9999 < loop.radius < 1
    poles = np.linalg.eigvals(loop.matrix)
    slowest = poles[np.argmax(np.abs(poles))]
    angles = abs(np.angle(slowest)) + np.linspace(-1, 1, 2001) * (1 - abs(slowest))
    for one in loop_margins(loop):
        A, B, C = broken(loop, one.joint)
        response = [(C @ np.linalg.solve(np.exp(1j * angle) * np.eye(len(A)) - A, B)).item() for angle in angles]
        disk = 1 / np.abs(1 / (1 + np.array(response)) - 0.5).max()
        assert one.disk == pytest.approx(disk, rel=1e-4)
        assert one.phase >= 2 * np.arctan(one.disk / 2) * (1 - 1e-4)


@pytest.mark.slow
@pytest.mark.parametrize(("bandwidth", "rate", "q"), [(36.0, 500.0, -0.4), (14.0, 200.0, -0.7)])
def test_poles_of_an_arm_without_friction_are_no_evaluated_frequencies(bandwidth, rate, q):
    """A pendulum's poles are on the unit circle, where z I - A is singular to the last digit."""
    robot = Robot.from_spec(ArmSpec.paper("r"), payload=Payload(mass=0.1))
    controller = ComputedTorque(bandwidth, 1.0, 0.2 * bandwidth**3)
    for delay in range(3):
        loop = sampled_loop(robot, [q], controller, Loop(rate=rate, delay=delay, velocity="exact"))
        (one,) = loop_margins(loop)
        assert times(loop, one.gain[1] * (1 - 1e-6)).radius < 1 < times(loop, one.gain[1] * (1 + 1e-6)).radius
