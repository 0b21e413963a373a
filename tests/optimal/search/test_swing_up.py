"""Guesses for joints without a motor."""

import numpy as np

import armdyn as ad
from armdyn.optimal.search.starts import spline, swing_up_guesses, swinging_time, via_guesses
from armdyn.optimal.task.policy.search import SearchPolicy
from problems import paper_problem

SWINGS = (SearchPolicy.swing_ups, SearchPolicy.swing_up_distance)


def problem_of(goal, **more):
    return ad.MinimumTimeProblem(ad.Robot.from_library("cart_pole"), q_start=[0, 0], q_goal=goal, **more)


def test_swings_go_to_and_fro_and_further():
    ways = swing_up_guesses(problem_of([0.0, np.pi]), np.random.default_rng(0), 30, *SWINGS)
    assert [len(way) for way in ways[:6]] == list(SearchPolicy.swing_ups)
    for way in ways:
        poses = np.array(way)
        assert np.all(np.abs(poses[:, 0]) <= 2)  # the rail's end
        assert np.all(np.sign(poses[:, 1]) == [(-1) ** (len(way) - j) for j in range(len(way))])
        assert poses[-1, 1] < 0  # the last swing is away from the goal
    means = np.mean([np.abs(np.array(way)[:, 1]) for way in ways if len(way) == 3], axis=0)
    np.testing.assert_allclose(means, np.pi * np.array([1, 2, 3]) / 4, rtol=0.5)  # five ways, 30 % each


def test_no_swings_where_nothing_is_to_swing():
    assert swing_up_guesses(problem_of([1.0, 0.0]), np.random.default_rng(0), 4, *SWINGS) == []
    assert swing_up_guesses(paper_problem("rr"), np.random.default_rng(0), 4, *SWINGS) == []


def test_the_straight_way_stays_the_first_guess_and_half_of_the_others_swing():
    ways = via_guesses(problem_of([0.0, np.pi]), 0, 9)
    assert ways[0] == [] and len(ways) == 9
    assert [len(way) for way in ways[1:]] == [1, 1, 1, 2, 1, 3, 1, 4]
    again = via_guesses(problem_of([0.0, np.pi]), 0, 9)
    assert all(np.array_equal(one, other) for one, other in zip(ways, again, strict=True))


def test_swinging_takes_the_time_of_a_pendulum():
    """Of a small swing of the pole on a cart that stands: one period of sqrt(l / g)."""
    problem = problem_of([0.0, np.pi])
    s = np.linspace(0, 1, 2001)
    q = 1e-3 * np.sin(2 * np.pi * s)
    inertia, weight = 0.3 * 0.5**2, 0.3 * 9.81 * 0.5
    static, inertial = (np.stack([np.zeros_like(s), x], axis=1) for x in (weight * q, -inertia * (2 * np.pi) ** 2 * q))
    assert np.isclose(swinging_time(problem, static, inertial), 2 * np.pi * np.sqrt(0.5 / 9.81), rtol=1e-9)
    assert swinging_time(problem, static, -inertial) == 0  # gravity does the contrary


def test_guesses_push_with_motors_only():
    problem = problem_of([0.0, np.pi])
    for way in via_guesses(problem, 0, 8):
        guess = spline(problem, way)
        assert not np.any(guess.tau[:, 1]) and np.all(np.abs(guess.tau[:, 0]) <= 20)
        assert 0 < guess.duration < 60
