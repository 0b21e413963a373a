"""Guesses: smooth, from pose to pose, within the arm's limits."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import armdyn as ad
from armdyn.optimal.mesh.starts import spline, swing_up_guesses, swinging_time, via_guesses
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.policy.search import SearchPolicy
from oracles import PinDynamics
from problems import POSES, cart, paper_problem

arm_problem = cache(paper_problem)
ANGLE = st.floats(-3, 3)
SWINGS = (SearchPolicy.swing_ups, SearchPolicy.midpoint_spread)


@pytest.mark.parametrize("arm", POSES)
@given(data=st.data())
def test_a_guess_goes_through_its_poses_at_equal_parts_of_the_time(arm, data):
    problem = arm_problem(arm)
    via = [np.array(data.draw(st.tuples(*len(arm) * [ANGLE]))) for _ in range(data.draw(st.integers(0, 3)))]
    guess = spline(problem, via)
    poses = [problem.q_start, *via, problem.q_goal]
    at = guess(guess.duration * np.linspace(0, 1, len(poses)))
    # Poses that fall between two of its samples are met by the cubic between these.
    np.testing.assert_allclose(at.q, poses, atol=2e-3)
    np.testing.assert_allclose(guess.q[[0, -1]], [problem.q_start, problem.q_goal], atol=1e-14)
    assert np.all(guess.tau >= problem.limits.effort_lower) and np.all(guess.tau <= problem.limits.effort_upper)


@pytest.mark.parametrize("limit", [2.0, 8.0, 1000.0])
def test_a_guess_keeps_velocity_limits(limit):
    problem = paper_problem("rr", velocity_limit=limit)
    guess = spline(problem, [np.array([0.5, -1.0])])
    assert np.all(np.abs(guess.v) <= limit * (1 + 1e-12))
    assert guess.duration >= problem.duration_bound()


def test_an_inertial_torque_meets_its_limit():
    """Without gravity and friction, the straight way is as fast as its torques allow."""
    problem = ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0])
    guess = spline(problem, [])
    # s³ (10 - 15 s + 6 s²) has |s''| <= 10/√3; 51 samples miss its peak by 5e-4 of it.
    assert guess.duration == pytest.approx(np.sqrt(2.0 * 10 / np.sqrt(3)), rel=1e-3)


@pytest.mark.parametrize(("duration_factor", "takes"), [(0.5, 0.5), (2.0, 2.0)])
def test_a_faster_guess_has_the_same_path(duration_factor, takes):
    problem, via = paper_problem("rr"), [np.array([0.5, -1.0])]
    plain, hasty = spline(problem, via), spline(problem, via, duration_factor)
    assert hasty.duration == pytest.approx(takes * plain.duration, rel=1e-12)
    np.testing.assert_array_equal(hasty.q, plain.q)
    np.testing.assert_allclose(hasty.v * takes, plain.v, atol=1e-12)
    np.testing.assert_array_equal(hasty.tau, plain.tau)


def test_no_guess_is_faster_than_velocity_limits_allow():
    problem = paper_problem("rr", velocity_limit=2.0)
    assert spline(problem, [], 0.01).duration == pytest.approx(problem.duration_bound(), rel=1e-12)


def test_random_poses_within_a_turn_are_as_likely_everywhere():
    problem = paper_problem("rr", position_limit=(-np.inf, np.inf))
    poses = np.array([way[0] for way in via_guesses(problem, 0, 2001, wide=(0.0, 8.0))[1:]])
    off = poses - (np.asarray(problem.q_goal) + np.asarray(problem.q_start)) / 2
    assert np.all(np.abs(off) <= 8)
    # 2000 draws of two joints: a quarter of them in each quarter, to five standard deviations of 1 %.
    shares = [np.mean((off >= low) & (off < low + 4), axis=0) for low in (-8, -4, 0, 4)]
    np.testing.assert_allclose(shares, 0.25, atol=0.05)


def test_torques_of_a_slow_guess_are_those_of_its_path():
    problem = paper_problem("rr", velocity_limit=0.5)
    guess, pin = spline(problem, []), PinDynamics(problem.robot)
    inner = slice(1, -1)
    a = np.gradient(guess.v, guess.t, axis=0)
    expected = [pin.rnea(*row) for row in zip(guess.q[inner], guess.v[inner], a[inner], strict=True)]
    # Differences of velocities 0.04 s apart stand in for accelerations of 0.1 rad/s².
    np.testing.assert_allclose(guess.tau[inner], expected, atol=1e-3)


def test_moving_ends_are_kept():
    problem = paper_problem("rr", v_start=[3.0, -2.0], v_goal=[1.0, 1.0])
    np.testing.assert_array_equal(spline(problem, []).v[[0, -1]], [[3.0, -2.0], [1.0, 1.0]])


def test_same_seed_same_guesses_and_they_fit_the_problem():
    problem = paper_problem("rr")
    first, second = ([spline(problem, way) for way in via_guesses(problem, seed=1, count=3)] for _ in range(2))
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a.q, b.q)
    np.testing.assert_allclose(spline(problem, []).q[[0, -1]], [problem.q_start, problem.q_goal], atol=1e-14)
    assert not np.array_equal(first[1].q, first[2].q)


@given(st.integers(0, 2**16), st.integers(1, 20))
def test_the_first_way_is_straight_and_all_are_within_limits(seed, count):
    problem = arm_problem("rr")
    ways = via_guesses(problem, seed, count)
    assert len(ways) == count and ways[0] == []
    limits = problem.limits
    assert all(np.all(limits.position_lower <= q) and np.all(q <= limits.position_upper) for way in ways for q in way)


def test_the_policys_numbers_make_the_guesses():
    """A number of the policy that is changed is another guess: nothing reads the class."""
    problem = paper_problem("rr", position_limit=(-np.inf, np.inf))
    problem = problem.variant(q_goal=problem.q_start + np.array([1e-3, 0.0]))
    policy = Policy.of(problem).search
    wider = replace(policy, least_spread=2 * policy.least_spread)
    one, other = (np.array(via_guesses(problem, 0, 5, policy=numbers)[1:]) for numbers in (policy, wider))
    middle = (np.asarray(problem.q_start) + np.asarray(problem.q_goal)) / 2
    np.testing.assert_allclose(other - middle, 2 * (one - middle), rtol=1e-12, atol=1e-12)


def test_more_guesses_begin_with_the_same():
    few, many = (via_guesses(arm_problem("rr"), 0, count) for count in (4, 9))
    for one, other in zip(few, many, strict=False):
        np.testing.assert_array_equal(one, other)


def test_ways_of_a_problem_with_via_points_pass_them():
    via = [[-0.7, 0.8], [-0.3, 0.9]]
    ways = via_guesses(paper_problem("rr", via=via), 0, 6)
    np.testing.assert_array_equal(ways[0], via)
    for way in ways[1:]:
        assert len(way) == 3
        rows = [list(q) for q in way]
        assert [row for row in rows if row in via] == via


def cart_pole(goal, **more):
    return ad.MinimumTimeProblem(ad.Robot.from_library("cart_pole"), q_start=[0, 0], q_goal=goal, **more)


def test_swing_up_guesses_swing_to_both_sides_with_growing_amplitude():
    ways = swing_up_guesses(cart_pole([0.0, np.pi]), np.random.default_rng(0), 30, *SWINGS)
    assert [len(way) for way in ways[:6]] == list(SearchPolicy.swing_ups)
    for way in ways:
        poses = np.array(way)
        assert np.all(np.abs(poses[:, 0]) <= 2)  # the rail's end
        assert np.all(np.sign(poses[:, 1]) == [(-1) ** (len(way) - j) for j in range(len(way))])
        assert poses[-1, 1] < 0  # the last swing is away from the goal
    means = np.mean([np.abs(np.array(way)[:, 1]) for way in ways if len(way) == 3], axis=0)
    np.testing.assert_allclose(means, np.pi * np.array([1, 2, 3]) / 4, rtol=0.5)  # five ways, 30 % each


def test_no_swing_up_guesses_without_passive_joints():
    assert swing_up_guesses(cart_pole([1.0, 0.0]), np.random.default_rng(0), 4, *SWINGS) == []
    assert swing_up_guesses(paper_problem("rr"), np.random.default_rng(0), 4, *SWINGS) == []


def test_the_straight_way_stays_the_first_guess_and_half_of_the_others_swing():
    ways = via_guesses(cart_pole([0.0, np.pi]), 0, 9)
    assert ways[0] == [] and len(ways) == 9
    assert [len(way) for way in ways[1:]] == [1, 1, 1, 2, 1, 3, 1, 4]
    again = via_guesses(cart_pole([0.0, np.pi]), 0, 9)
    assert all(np.array_equal(one, other) for one, other in zip(ways, again, strict=True))


def test_swinging_takes_the_time_of_a_pendulum():
    """Of a small swing of the pole on a cart that stands: one period of sqrt(l / g)."""
    problem = cart_pole([0.0, np.pi])
    s = np.linspace(0, 1, 2001)
    q = 1e-3 * np.sin(2 * np.pi * s)
    inertia, weight = 0.3 * 0.5**2, 0.3 * 9.81 * 0.5
    static, inertial = (np.stack([np.zeros_like(s), x], axis=1) for x in (weight * q, -inertia * (2 * np.pi) ** 2 * q))
    assert np.isclose(swinging_time(problem, static, inertial), 2 * np.pi * np.sqrt(0.5 / 9.81), rtol=1e-9)
    assert swinging_time(problem, static, -inertial) == 0  # gravity does the contrary


def test_guesses_push_with_motors_only():
    problem = cart_pole([0.0, np.pi])
    for way in via_guesses(problem, 0, 8):
        guess = spline(problem, way)
        assert not np.any(guess.tau[:, 1]) and np.all(np.abs(guess.tau[:, 0]) <= 20)
        assert 0 < guess.duration < 60
