"""Bang-bang arcs: read from the signs of S, and with samples along them, on the double integrator."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armdyn.optimal.problem.status import Status, Stop
from armdyn.optimal.verify.arc import Arc, Mode
from armdyn.paper.indirect.bang_bang import BangBangExtremal, BangBangProblem, guess_arcs, with_samples
from armdyn.paper.indirect.canonical import canonical_system
from oracles import robot_named
from paper.indirect.carts import cart_bang_bang, cart_guess

HALF = np.sqrt(2)
"""Of the exact duration over 2 m [s]."""


def exact():
    """Full force forth and back, with ρ = ∂(time to go)/∂x."""
    starts = np.array([[0.0, 0.0, -1 / HALF, -1.0], [1.0, HALF, -1 / HALF, 0.0]])
    return BangBangExtremal((Arc(HALF, (Mode.UPPER,)), Arc(HALF, (Mode.LOWER,))), (0,), starts)


def two_links():
    bound = np.full(2, 3.0)
    return BangBangProblem(canonical_system(robot_named("rr")), np.zeros(4), np.ones(4), -bound, bound, 1e-10, Stop())


def test_torques_are_those_of_the_modes():
    problem = replace(cart_bang_bang(), lower=np.array([-0.5]))
    np.testing.assert_array_equal(problem.torques(cart_guess().arcs), [[1.0], [-0.5]])


def test_arcs_are_read_from_the_signs_of_s():
    t = np.linspace(0, 3, 7)
    y = np.array([0 * t, 0 * t, -1 + 0 * t, t - 1.2])
    guess = guess_arcs(cart_bang_bang(), t, y)
    assert [arc.modes for arc in guess.arcs] == [(Mode.UPPER,), (Mode.LOWER,)]
    np.testing.assert_allclose(guess.lengths, [1.2, 1.8], rtol=1e-12)  # S = ρ_v is linear
    assert guess.duration == pytest.approx(3, rel=1e-12)
    np.testing.assert_allclose(guess.starts[1], [0, 0, -1, 0], atol=1e-12)
    assert guess.switches == (0,)


@settings(deadline=None)  # the first example builds the system
@given(st.lists(st.floats(-1, 1).filter(lambda x: abs(x) > 1e-3), min_size=8, max_size=20))
def test_arcs_are_as_long_as_the_motion_and_one_joint_switches_at_a_time(numbers):
    t = np.linspace(0.5, 2.0, len(numbers) // 2)
    y = np.zeros((8, t.size))
    y[6:] = np.reshape(numbers[: 2 * t.size], (2, -1))
    guess = guess_arcs(two_links(), t, y)
    assert guess.duration == pytest.approx(1.5, rel=1e-12)
    assert np.all(guess.lengths >= 0)
    assert len(guess.arcs) == len(guess.switches) + 1 == len(guess.starts)
    for before, after, joint in zip(guess.arcs[:-1], guess.arcs[1:], guess.switches, strict=True):
        assert [i for i in range(2) if before.modes[i] != after.modes[i]] == [joint]


def test_samples_are_the_motion():
    found = with_samples(cart_bang_bang(), exact())
    t, y = found.path
    assert np.all(np.diff(t) > 0) and t[-1] == pytest.approx(2 * HALF, rel=1e-12)
    first = t <= HALF
    np.testing.assert_allclose(y[0, first], t[first] ** 2 / 2, atol=1e-12)
    np.testing.assert_allclose(y[0, ~first], 2 - (2 * HALF - t[~first]) ** 2 / 2, atol=1e-12)
    np.testing.assert_allclose(y[3], t / HALF - 1, atol=1e-12)
    assert found.wrong_sign < 1e-12


def test_a_wrong_sign_is_the_possible_decrease_of_h():
    arcs = (Arc(HALF, (Mode.LOWER,)), Arc(HALF, (Mode.UPPER,)))
    found = with_samples(cart_bang_bang(), replace(exact(), arcs=arcs))
    # S is −1 at the start; the torque could go from −1 N to 1 N.
    assert found.wrong_sign == pytest.approx(2, rel=1e-9)


def test_a_motion_that_cannot_be_integrated_is_reported():
    # Centrifugal torques of 1e50 rad/s leave no step.
    wild = BangBangExtremal((Arc(0.06, (Mode.UPPER, Mode.UPPER)),), (), np.full((1, 8), 1e50))
    with np.errstate(invalid="ignore", over="ignore"):
        found = with_samples(two_links(), wild)
    assert found.status is Status.FAILED and "integrated" in found.message
