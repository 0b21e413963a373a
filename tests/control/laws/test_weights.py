from itertools import pairwise

import numpy as np
import pytest

import armdyn as ad
from armdyn.control.laws.linear import Steps
from armdyn.control.laws.lqr import ErrorWeights, bearable, diagonals, lag
from armdyn.control.stability.rate import sampled_stability
from oracles import robot_named


def test_a_ramp_seen_through_the_filter_is_late_by_its_lag():
    # Of v = t the filter shows t less its mean age once it has settled; half a tick is the difference's, and delay and
    # half a tick of hold come after it.
    loop = ad.Loop(rate=500.0, cutoff=20.0, delay=2)
    t = np.arange(2000) * loop.period
    q, shown = t**2 / 2, 0.0
    for before, now in pairwise(q):
        shown = loop.pole * shown + (1 - loop.pole) * (now - before) * loop.rate
    assert t[-1] - shown + 2.5 * loop.period == pytest.approx(lag(loop), abs=1e-9)  # the filter has forgotten its start


def test_other_velocities_do_not_lag():
    assert lag(ad.Loop(velocity="observer", delay=1)) == pytest.approx(1.5e-3)
    assert lag(ad.Loop(velocity="exact", delay=0, rate=2000.0)) == pytest.approx(0.25e-3)
    assert lag(ad.Loop.ideal()) == 0.0


def cart(mobility, rate):
    """Two carts from tick to tick."""
    h = 1 / rate
    A = np.block([[np.eye(2), h * np.eye(2)], [np.zeros((2, 2)), np.eye(2)]])
    return Steps(A[None], np.vstack([np.diag(mobility) * h**2 / 2, np.diag(mobility) * h])[None])


@pytest.mark.parametrize(("velocity", "phase_of"), [(0.001, "swing"), (0.05, "velocity loop")])
def test_a_light_joint_is_as_stiff_as_its_lag_bears(velocity, phase_of):
    loop, half, phase = ad.Loop(), np.array([3.0, 3.0]), 1.1
    mobility = np.array([2000.0, 1.0])
    requested = ErrorWeights(np.array([0.03, 0.03]), np.full(2, velocity), np.zeros(2))
    given = bearable(requested, half, cart(mobility, loop.rate), loop, phase)
    assert given.position[1] == 0.03  # the heavy one is slow enough
    assert given.position[0] > 0.03
    w = np.sqrt(mobility[0] * half[0] / given.position[0])
    costs = {"swing": w * lag(loop) / phase, "velocity loop": velocity * w**2 * lag(loop) / (3 * phase)}
    assert costs.pop(phase_of) == pytest.approx(1.0, rel=1e-12)
    assert max(costs.values()) < 1.0
    assert bearable(requested, half, cart(mobility, 1000.0), ad.Loop.ideal(), phase) == requested


def test_weights_depend_on_the_phase_of_the_motion():
    weights = ErrorWeights(np.array([0.1, 0.5]), np.array([0.01, 0.02]), np.array([2.0, 0.0]))
    rows = diagonals(weights, 1, (0.5, 0.25), np.array([True, False]))
    assert rows[1] == pytest.approx([100, 4, 0.01, 0.0016, 400, 0, 0, 0])
    assert rows[0] == pytest.approx([25, 1, 0.01 / 16, 0.0016 / 16, 0, 0, 0, 0])


@pytest.mark.parametrize("name", ["kinova", "z1", "panda", "ur5"])
def test_it_holds_arms_with_light_wrists(name):
    robot = robot_named(name)
    goal = np.full(robot.nv, 0.3)
    for loop in (
        ad.Loop(),
        ad.Loop(delay=2),
        ad.Loop(rate=500.0),
        ad.Loop(rate=250.0, cutoff=40.0),
        ad.Loop(velocity="observer"),
    ):
        assert sampled_stability(robot, goal, ad.Lqr(), loop).stable


def test_without_regard_to_the_lag_a_light_wrist_is_unstable():
    robot = robot_named("kinova")
    assert not sampled_stability(robot, np.full(robot.nv, 0.3), ad.Lqr(phase=1000.0), ad.Loop()).stable
