"""Torques that keep to a motion, where the first-order model is exact: a cart."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.optimal.landing.feedback import tracked
from armdyn.optimal.landing.pieces import Pieces
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.landing.variation import Step
from armdyn.optimal.task.task import Task
from problems import both_sides, cart

PIECES = 20
ENDS = np.linspace(0, 4, PIECES + 1)


def task():
    return Task.of(ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0]))


def led(motion, tau, steps, offset):
    found = tracked(task(), motion, Pieces(ENDS, tau), steps, offset)
    return None if found is None else found.tau


def steps(tau):
    """x' = A x + b u over one piece, and what a little more time adds at its end."""
    h = ENDS[1]
    through, forced = np.array([[1.0, h], [0.0, 1.0]]), np.array([[h**2 / 2], [h]])
    return [Step(through, forced, np.array([0.0, h * u])) for (u,) in tau]


def stepped(tau):
    """The cart's motion by constant forces, shape (PIECES, 1), from rest at 0."""
    t, zero = both_sides(ENDS), np.zeros((2 * PIECES, 1))
    return replay_torques(cart(), ad.Trajectory(t, zero, zero, np.repeat(tau, 2, axis=0), ("slide",)))


# Half of the force, so that there is some left on either side: 0.5 N for 2 s there and back make 2 m.
FORCE = np.where(ENDS[:-1] < 2, 0.5, -0.5)[:, None]


def test_what_needs_no_correction_gets_none():
    motion = stepped(FORCE)
    np.testing.assert_allclose(motion.q[-1], 2.0, atol=1e-12)
    # The replay is exact to rounding, gains are below 1e3 N/m.
    np.testing.assert_allclose(led(motion, FORCE, steps(FORCE), np.zeros(2)), FORCE, atol=1e-9)


def test_a_weak_push_is_made_up_for():
    motion, weak = stepped(FORCE), 0.9 * FORCE
    assert abs(stepped(weak).q[-1, 0] - 2.0) > 0.1
    found = led(motion, weak, steps(weak), np.zeros(2))
    replay = stepped(found)
    assert np.abs(replay.q[-1, 0] - 2.0) < 5e-3 and np.abs(replay.v[-1, 0]) < 0.05
    assert np.all(np.abs(found) <= 1.0)


@pytest.mark.parametrize("aside", [-0.01, 0.01])
def test_it_ends_where_it_is_told_beside_the_motion(aside):
    motion = stepped(FORCE)
    replay = stepped(led(motion, FORCE, steps(FORCE), np.array([aside, 0.0])))
    assert 0.4 < (replay.q[-1, 0] - 2.0) / aside <= 1.0  # feedback lags; whoever aims asks again
    before = np.linspace(0, 0.69 * ENDS[-1], 30)  # it turns aside in the last three tenths only
    np.testing.assert_allclose(replay(before).q, motion(before).q, atol=1e-9)


def test_a_motion_that_is_lost_is_said_to_be():
    deaf = [Step(np.eye(2), np.zeros((2, 1)), np.zeros(2))] * PIECES  # no torque tells: the feedback does nothing
    assert led(stepped(FORCE), -FORCE, deaf, np.zeros(2)) is None
