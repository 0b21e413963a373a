"""Delay margins against the spectral radius of the loop with a late torque, and against the real loop."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.linalg import expm

import armdyn as ad
from armdyn.control.laws.readings import law_function, table
from armdyn.control.loop.loop import Law
from armdyn.control.stability.delay import delay_margin
from armdyn.control.stability.margins import broken, frequencies
from armdyn.errors import ProblemError
from pid_loops import example
from problems import cart

R, RR = example("R Ex4", grams=100.6), example("RR Ex5", grams=100.6)


def held(arm, time):
    """Displacement of (q, v) in a time, by (q, v) and by torques that are held."""
    n, nv = arm.B.shape
    step = expm(np.block([[arm.A, arm.B], [np.zeros((nv, n + nv))]]) * time)
    return step[:n, :n], step[:n, n:]


def late_radius(loop, joint, delay):
    """Spectral radius with one joint's torque late: the past commands are states, the newest first."""
    ticks, part = divmod(delay / loop.period, 1.0)
    ticks, size, n = int(ticks), len(loop.A), len(loop.arm.A)
    first, second = held(loop.arm, part * loop.period), held(loop.arm, (1 - part) * loop.period)
    older, newer = np.zeros((2, size))
    older[:n], newer[:n] = second[0] @ first[1][:, joint], second[1][:, joint]
    others = loop.B.copy()
    others[:, joint] = 0
    M = np.zeros((size + ticks + 1,) * 2)
    M[:size, :size] = loop.A + others @ loop.C
    M[size, :size], M[size + 1 :, size:-1] = loop.C[joint], np.eye(ticks)
    commands = np.eye(len(M))[size:]
    now = commands[ticks - 1] if ticks else np.append(loop.C[joint], 0.0)
    M[:size] += np.outer(newer, now) + np.outer(older, commands[ticks])
    return np.abs(np.linalg.eigvals(M)).max()


def margin(loop, joint):
    opened = broken(loop, joint)
    return delay_margin(loop, joint, opened, frequencies(loop, opened[0]))


def assert_first_instability(loop, joint, scan=60):
    """Stable up to the margin, unstable beyond; the parts are not the steps of the march."""
    delay = margin(loop, joint)
    assert late_radius(loop, joint, delay * (1 - 1e-5)) < 1 < late_radius(loop, joint, delay * (1 + 1e-5))
    assert all(late_radius(loop, joint, part * delay) < 1 for part in np.linspace(0, 0.9999, scan))
    return delay / loop.period


CASES = {
    "R, torque": (R, ad.Pid(ad.PidGains(30, 50, 10), "torque"), ad.Loop()),
    "R, ticks": (R, ad.Pid(ad.PidGains(10, 20, 0.5), "torque"), ad.Loop()),
    "R, acceleration": (R, ad.Pid(ad.PidGains(30, 50, 10), "acceleration"), ad.Loop(rate=60.0)),
    "RR, computed torque": (RR, ad.ComputedTorque(80.0, 0.3, 1e4), ad.Loop(rate=500.0, velocity="exact")),
    "RR, lqr": (RR, ad.Lqr(), ad.Loop(rate=150.0, velocity="observer")),
}


@pytest.mark.parametrize("case", CASES)
def test_stable_until_the_margin(case):
    (robot, poses), controller, how = CASES[case]
    loop = ad.sampled_loop(robot, poses["q_goal"], controller, how)
    ticks = [assert_first_instability(loop, joint) for joint in range(robot.nv)]
    assert all(abs(one - round(one)) > 1e-3 for one in ticks)  # parts of a tick are met


def test_a_double_integrator_in_closed_form():
    """Jury's condition of a mass whose velocity is fed back, v(k+1) = v(k) - (1 - p) a v(k-1) - p a v(k-2), a = kd h/m.

    z³ - z² + (1 - p) a z + p a has its zeros within the unit circle until 1 - (p a)² = a. With a whole tick less,
    z² - (1 - (1 - p) a) z + p a, they are there for every p.
    """
    a, h = 0.8, 0.01
    controller = ad.Pid(ad.PidGains(0.0, 0.0, a / h), "torque")
    loop = ad.sampled_loop(cart(), [0.1], controller, ad.Loop(rate=1 / h, delay=0, velocity="exact"))
    assert margin(loop, 0) / h == pytest.approx(1 + np.sqrt(1 - a) / a, rel=1e-5)  # ten times the last step


def test_stability_that_is_lost_within_a_tick_and_comes_back():
    """Of a torque that is large at every second tick: with 1.3 ticks more the loop is stable again."""
    controller = ad.Lqr(position=0.0113, phase=2.457)
    loop = ad.sampled_loop(R[0], R[1]["q_goal"], controller, ad.Loop(rate=338.4, delay=2, velocity="exact"))
    assert 0.9 < assert_first_instability(loop, 0) < 0.95
    assert late_radius(loop, 0, 1.05 * loop.period) > 1.01
    assert late_radius(loop, 0, 1.3 * loop.period) < 1


def test_a_loop_that_no_delay_makes_unstable():
    """Its torque is less than gravity's restoring one, and the joint is damped: L stays below 1."""
    robot = R[0].with_friction(damping=0.5)
    loop = ad.sampled_loop(robot, [-np.pi / 2], ad.Pid(ad.PidGains(0.01, 0.0, 0.01), "torque"), ad.Loop())
    assert margin(loop, 0) == np.inf
    assert all(late_radius(loop, 0, ticks * loop.period) < 1 for ticks in np.linspace(0, 40, 50))


def test_an_arm_without_friction_has_poles_on_the_circle():
    """A pendulum that hangs: no frequency of the scan is its own."""
    assert_first_instability(ad.sampled_loop(R[0], [-1.785], ad.Lqr(), ad.Loop(rate=131.3, velocity="exact")), 0)


@dataclass(frozen=True)
class EveryFew:
    """A PD controller that decides at each `every`-th tick of a faster loop, and repeats its command between them."""

    kp: float
    kd: float
    every: int

    def law(self, robot, ticks, loop):
        if not loop.delay:
            raise ProblemError("there is no command to repeat")
        count = np.arange(20_000) % self.every == 0
        columns = {"decides": count[:, None].astype(float), "q": ticks.q[-1], "tau": robot.holding_torque(ticks.q[-1])}

        def torque(given):
            decided = given.row["tau"] + self.kp * (given.row["q"] - given.q) - self.kd * given.v
            now = given.row["decides"]
            return now * decided + (1 - now) * given.pending[-1]

        return Law(law_function(1, loop.delay, columns, torque), table(columns), np.zeros(1))


@pytest.mark.slow
def test_the_real_loop_with_a_part_of_a_tick():
    """A loop of 200 Hz in one of 4 kHz, whose delay is any twentieth of a tick: its swing decays, and then grows.

    From tick to tick it changes by the spectral radius, to 2 % of the swing over 500 ticks: samples miss its peaks.
    """
    (robot, poses), every, slow = R, 20, ad.Loop(rate=200.0, delay=1, velocity="exact", encoder=0.0)
    goal, controller = np.array(poses["q_goal"]), EveryFew(18.0, 0.9, every)
    loop = ad.sampled_loop(robot, goal, ad.Pid(ad.PidGains(18.0, 0.0, 0.9), "torque"), slow)
    parts = margin(loop, 0) / loop.period * every
    assert 50 < parts < 51
    for late in (50, 51, 52):
        real = replace(slow, rate=every * slow.rate, delay=every + late)
        run = ad.track(robot, ad.set_point(robot, goal), controller, loop=real, q_start=goal + 1e-3, duration=4.0)
        swing = np.abs(run.trajectory.q[:-1, 0] - goal).reshape(8, -1).max(axis=1)
        grows = (swing[7] / swing[2]) ** (1 / 500)
        assert grows == pytest.approx(late_radius(loop, 0, late * loop.period / every), abs=5e-5)
        assert (grows > 1) == (late > parts)
