"""Motions along all joints' profiles: against Ruckig, the proven bound, and an independent look at their limits."""

import numpy as np
import pytest
import ruckig

import armdyn as ad
from armdyn.optimal.curves.profiles import profiles, synchronous
from armdyn.optimal.problem.planning_limits import Profiles
from armdyn.optimal.problem.task import Task
from problems import POSES, paper_arm, solve

RATES = [
    {"acceleration_limit": 15.0},
    {"acceleration_limit": 8.0, "jerk_limit": 100.0},
    {"jerk_limit": 150.0},
    {"acceleration_limit": [8.0, 6, 8, np.inf, 9, 9], "jerk_limit": 90.0},
]


def random_problem(seed, **rates):
    robot, random = ad.Robot.from_library("ur5"), np.random.default_rng(seed)
    poses = random.uniform(-1.5, 1.5, (2, 6))
    poses[1, 4] = poses[0, 4]  # a joint that stays
    return ad.MinimumTimeProblem(robot, q_start=poses[0], q_goal=poses[1], **rates)


def time_of_ruckig(problem):
    """Duration of Ruckig's motion within the same limits [s]."""
    n = problem.robot.nv
    way = ruckig.InputParameter(n)
    way.current_position, way.target_position = list(problem.q_start), list(problem.q_goal)
    way.max_velocity = list(problem.limits.velocity)
    way.max_acceleration = [1e12] * n if problem.acceleration_limit is None else list(problem.acceleration_limit)
    way.max_jerk = [1e18] * n if problem.jerk_limit is None else list(problem.jerk_limit)
    found = ruckig.Trajectory(n)
    assert ruckig.Ruckig(n).calculate(way, found) in (ruckig.Result.Working, ruckig.Result.Finished)
    return found.duration


@pytest.mark.parametrize("rates", RATES[:3])
@pytest.mark.parametrize("seed", range(3))
def test_durations_are_ruckigs(rates, seed):
    problem = random_problem(seed, **rates)
    limits = (problem.limits.velocity, problem.acceleration_limit, problem.jerk_limit)
    found = Profiles.of(
        np.abs(problem.q_goal - problem.q_start), *(np.inf * np.ones(6) if one is None else one for one in limits)
    )
    # Ruckig has no infinite limits: 1e12 rad/s² and 1e18 rad/s³ take some 1e-6 s.
    assert np.max(found.durations) == pytest.approx(time_of_ruckig(problem), rel=1e-5)


@pytest.mark.parametrize("rates", RATES)
@pytest.mark.parametrize("seed", range(3))
def test_curves_keep_limits_and_reach_one(rates, seed):
    """Differences of dense positions, which know nothing of phases; the slowest joint is on a limit."""
    problem = random_problem(seed, **rates)
    none = np.full(6, np.inf)
    limits = [problem.limits.velocity]
    limits += [none if one is None else one for one in (problem.acceleration_limit, problem.jerk_limit)]
    curve = synchronous(problem, tuple(limits))
    t = np.linspace(0, curve.duration, 4001)
    ends = np.append(0.0, np.cumsum([leg.duration for leg in curve.legs]))
    which = np.clip(np.searchsorted(ends, t, side="right") - 1, 0, len(curve.legs) - 1)
    s = [(time - ends[k]) / curve.legs[k].duration for k, time in zip(which, t, strict=True)]
    q = np.vstack([curve.legs[k].at(np.array([part]))[0] for k, part in zip(which, s, strict=True)])
    np.testing.assert_allclose(q[[0, -1]], problem.poses[[0, -1]], atol=1e-12)
    np.testing.assert_allclose(q[:, 4], q[0, 4], rtol=1e-15)
    h, worst = t[1], []
    for order, limit in enumerate(limits, start=1):
        rate = np.abs(np.diff(q, order, axis=0)) / h**order
        # Means over steps stay within; rounding of 1e-15 rad grows by h⁻³.
        assert np.all(rate <= limit * (1 + 1e-9) + 1e-14 / h**order)
        worst.append(np.max(rate / limit))
    assert max(worst) == pytest.approx(1, rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("rates", RATES)
def test_motions_are_proven_and_keep_limits(rates):
    problem = random_problem(7, **rates)
    solution = solve(problem)
    assert solution.usable and solution.certified and solution.gap < 5e-4 and solution.gap_proven
    assert {share.joint for share in solution.decides} == {solution.decides[0].joint}
    assert solution.replay_error < 1e-6 and solution.iterations == 0  # no other method
    unknown = solve(problem, bound=False)
    assert unknown.iterations == 0 and unknown.duration == solution.duration


@pytest.mark.slow
def test_torques_beyond_their_limits_leave_it_to_other_methods():
    limits = {"acceleration_limit": 100.0, "effort_limit": 3.0, "velocity_limit": 10.0}
    problem = ad.MinimumTimeProblem(paper_arm("rr"), q_start=[-1.5, 0], q_goal=[0.2, 0.3], **limits)
    assert profiles(Task.of(problem, ad.MinimumTimeOptions()))[0] == []
    solution = solve(problem)
    assert solution.usable and solution.duration > solution.lower_bound * 1.01


def test_only_where_every_joint_has_one_from_rest_to_rest():
    def methods(**more):
        given = {"q_start": [0.0, 0], "q_goal": [0.5, 0.5], "acceleration_limit": [5.0, 5], **more}
        return Task.of(ad.MinimumTimeProblem(paper_arm("rr"), **given), ad.MinimumTimeOptions()).policy.strategy.methods

    assert methods()[0] == "profiles"
    for other in (
        {"acceleration_limit": [5.0, np.inf]},
        {"jerk_limit": [np.inf, 90.0]},
        {"v_goal": [0.1, 0]},
        {"via": [[0.2, 0.3]]},
        {"effort_weight": 1e-3},
        {"acceleration_limit": None},
    ):
        assert methods(**other)[0] != "profiles"


@pytest.mark.slow
def test_an_obstacle_in_the_way_is_avoided_by_another_method():
    limits = {"q_start": POSES["rr"][0], "q_goal": POSES["rr"][1], "acceleration_limit": 40.0, "velocity_limit": 5.0}
    free = solve(ad.MinimumTimeProblem(paper_arm("rr"), **limits))
    ball = ad.Sphere((0.33, 0, -0.12), 0.05)
    around = solve(ad.MinimumTimeProblem(paper_arm("rr"), **limits, obstacles=[ball]), starts=2)
    assert free.certified and around.usable and around.clearance.distance > 0
    assert around.duration > 1.01 * free.duration
