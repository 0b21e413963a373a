"""Indices of runs whose integrals are known, and their search."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.control.tracking.track import Setup
from armdyn.studies.tuning.index import Performance, index_of, performance_of
from problems import POSES, paper_arm

GOAL = np.array([1.0, -2.0])
ROBOT = paper_arm("rr")


@pytest.fixture(scope="module")
def setup():
    return Setup.of(ROBOT, ad.set_point(ROBOT, GOAL), ad.Pid(), ad.Loop(), duration=5.0, tolerance=0.005)


def run(t, q, settled_time=None):
    """A run at these positions, shape (n, nv)."""
    motion = ad.Trajectory(t, q, np.zeros_like(q), np.zeros_like(q))
    status = "not_settled" if settled_time is None else "settled"
    return ad.Run(motion, status, "", settled_time, 0.0, 0.0, 0.0, 0.0, None, np.zeros(2))


def test_integrals_of_a_decaying_error(setup):
    t = np.linspace(0, 5, 20_001)
    q = GOAL + np.exp(-t)[:, None] * np.array([0.5, -1.0])
    # ∫₀⁵ t e⁻ᵗ dt = 1 - 6 e⁻⁵, ∫₀⁵ e⁻²ᵗ dt = (1 - e⁻¹⁰)/2; the trapezoidal rule with 0.25 ms is within h²/12.
    assert index_of(run(t, q), setup, "itae") == pytest.approx(1.5 * (1 - 6 * np.exp(-5)), abs=1e-7)
    assert index_of(run(t, q), setup, "ise") == pytest.approx(1.25 * (1 - np.exp(-10)) / 2, abs=1e-7)


def test_a_run_that_broke_off_stays_where_it_was(setup):
    t = np.linspace(0, 2, 1001)
    q = GOAL + np.tile([3.0, 0.0], (1001, 1))
    assert index_of(run(t, q), setup, "itae") == pytest.approx(3 * 5**2 / 2)
    assert index_of(run(t, q), setup, "ise") == pytest.approx(9 * 5)


def test_a_run_that_does_not_settle_costs_more_than_any_that_does_and_more_the_farther_it_is(setup):
    t = np.linspace(0, 5, 101)

    def beside(error):
        return index_of(run(t, GOAL + np.full((101, 2), error)), setup, "settled")

    assert index_of(run(t, GOAL + np.zeros((101, 2)), 4.99), setup, "settled") == 4.99
    costs = [beside(error) for error in (0.006, 0.01, 0.1, 1.0, 50.0)]
    assert costs == sorted(costs)
    assert costs[0] > 5.0
    early = index_of(run(t / 5, GOAL + np.full((101, 2), 50.0)), setup, "settled")
    assert early > costs[-1]


def test_overshoot_costs_in_proportion():
    inside = Performance(0.5, 6, 6, 0.5, 0.05)
    assert inside.cost(0.05) == 0.5
    assert replace(inside, overshoot=0.10).cost(0.05) == pytest.approx(1.0)
    assert replace(inside, beyond_limits=6).cost(0.05) == pytest.approx(10 * inside.cost(0.05))


def test_worth_is_of_the_worst_arm():
    arms = ad.Plants(coulomb=(0, 0.06), damping=(0, 0.003)).corners(ROBOT)
    reference = ad.ramp(ROBOT, *POSES["rr"], 0.45)
    controller = ad.Pid(ad.PidGains(6000.0, 100.0, 180.0), form="computed_torque")
    setup = Setup.of(ROBOT, reference, controller, ad.Loop(), duration=1.0, tolerance=0.005)
    runs = [setup.run(arm) for arm in arms]
    found = performance_of(setup, arms, "settled")
    assert found.index == found.settled_time == max(run.settled_time for run in runs)
    assert (found.settled, found.count) == (6, 6)
    travel = np.abs(np.subtract(*POSES["rr"])).max()
    assert found.overshoot == pytest.approx(max(run.overshoot.max() for run in runs) / travel)
    # The ramp's largest speed is 15/8 of its mean.
    slow, speed = [arm.with_limits(None, 15 / 8 * travel / 0.45 / 1.1) for arm in arms[:2]], "2 exceed velocity"
    assert found.beyond_limits == 0 and speed not in str(found)
    assert speed in str(performance_of(setup, [*slow, arms[2]], "settled"))
    assert performance_of(setup, arms, "ise").index == max(index_of(run, setup, "ise") for run in runs)
