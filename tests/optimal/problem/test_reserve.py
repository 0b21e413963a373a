"""Reserve of the limits for feedback: the same solutions as with limits reduced by it."""

import warnings

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.answer.solution import minimum_time_summary, reserve_summary
from armdyn.optimal.bound.lower_bound import lower_bound
from armdyn.optimal.gap import time_optimality
from armdyn.paper.indirect.solve_indirect import IndirectOptions, solve_indirect
from armdyn.studies.continuation import continuation
from problems import POSES, paper_arm, paper_problem, solve

SAME = 1e-7
"""Relative: certified durations agree to about 1e-9; two searches may end in different meshes."""


def test_limits_are_less_by_the_reserve_joint_by_joint():
    limits = paper_problem(
        "rr", effort_limit=([-1.0, -2.0], [3.0, 5.0]), velocity_limit=[4.0, np.inf],
        reserve=[0.1, 0.2], velocity_reserve=0.25,
    ).limits  # fmt: skip
    # One rounding of a product and one of 1 - r: two ulps.
    np.testing.assert_allclose(limits.effort_lower, [-0.9, -1.6], rtol=5e-16)
    np.testing.assert_allclose(limits.effort_upper, [2.7, 4.0], rtol=5e-16)
    np.testing.assert_array_equal(limits.velocity, [3.0, np.inf])


def test_without_a_reserve_limits_are_the_robots_to_the_last_bit():
    problem, own = paper_problem("rr"), paper_arm("rr").limits
    assert not problem.reserves.any
    np.testing.assert_array_equal(problem.limits.effort_upper, own.effort_upper)
    np.testing.assert_array_equal(problem.limits.effort_lower, own.effort_lower)
    np.testing.assert_array_equal(problem.limits.velocity, own.velocity)


def test_a_joint_without_a_motor_has_none_with_a_reserve_either():
    problem = ad.MinimumTimeProblem(
        ad.Robot.from_library("cart_pole"), q_start=[0, 0], q_goal=[0, np.pi], effort_limit=10, reserve=0.1
    )
    np.testing.assert_array_equal(problem.limits.passive, [False, True])
    assert problem.limits.effort_upper[0] == pytest.approx(9.0, rel=1e-15)


@pytest.mark.parametrize("name", ["reserve", "velocity_reserve"])
@pytest.mark.parametrize(
    ("value", "message"),
    [
        (-0.1, "of joint 'joint1' is -0.1; it must be a part of the limit, at least 0 and below 1"),
        (1.0, "of joint 'joint1' is 1.0; it must be a part"),
        ([0.1, 1.5], r"of joint 'joint2' is 1.5 \(index 1\); it must be a part"),
        ([0.1, np.nan], r"of joint 'joint2' is nan \(index 1\); it must be finite"),
        ([0.1, 0.1, 0.1], r"has shape \(3,\); expected one number or 2, one per joint: joint1, joint2"),
        ("a tenth", "is 'a tenth'"),
        (None, "is None"),
        (True, "is True"),
    ],
)
def test_a_wrong_part_of_a_limit_is_refused(name, value, message):
    with pytest.raises(ProblemError, match=f"^{name} {message}"):
        paper_problem("rr", **{name: value})


def test_a_torque_that_cannot_be_zero_has_no_reserve():
    with pytest.raises(ProblemError, match=r"reserve of joint 'joint1' is 0.1 .index 0., but .*\[1, 3\] N m.* zero"):
        paper_problem("rr", effort_limit=([1.0, -3.0], [3.0, 3.0]), reserve=0.1)


def test_a_state_faster_than_the_remaining_limit_is_refused_with_the_reserve():
    message = r"start velocity of joint 'joint1' .* 4.5 rad/s, beyond its limit 4 rad/s .20 % of 5 rad/s is kept"
    with pytest.raises(ProblemError, match=message):
        paper_problem("rr", velocity_limit=5, velocity_reserve=0.2, v_start=[4.5, 0.0])
    assert paper_problem("rr", velocity_limit=5, v_start=[4.5, 0.0]).limits.velocity[0] == 5


def test_no_velocity_worth_its_name_is_refused():
    with pytest.raises(ProblemError, match="velocity limit"):
        paper_problem("rr", velocity_limit=1e-8, velocity_reserve=0.99)


def test_a_goal_whose_holding_torque_takes_of_the_reserve_is_warned_of():
    held = paper_problem("rr", 0.2).holding_torque()[0]
    reserve = 1 - 0.9 * held / 3  # leaves nine tenths of the holding torque at the goal
    with pytest.warns(ad.ArmdynWarning, match=r"of 3 N m is kept in reserve\).*takes of the reserve"):
        problem = paper_problem("rr", 0.2, reserve=reserve)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        problem.variant(reserve=0.0)
        paper_problem("rr", 0.2)
    with pytest.warns(ad.ArmdynWarning, match=r"kept in reserve\).*beyond this actuator"):
        paper_problem("rr", 1.0, reserve=0.1)  # 5.5 N m are beyond all 3


@pytest.mark.parametrize(("arm", "reserve"), [("r", 0.3), ("rr", 0.1), ("rr", [0.3, 0.05])])
def test_the_answer_is_that_of_lesser_limits(arm, reserve):
    kept = solve(paper_problem(arm, reserve=reserve))
    lesser = solve(paper_problem(arm, effort_limit=list(3.0 * (1 - np.broadcast_to(reserve, kept.problem.robot.nv)))))
    assert kept.certified and lesser.certified
    assert kept.duration == pytest.approx(lesser.duration, rel=SAME)
    np.testing.assert_allclose(
        np.abs(kept.trajectory.tau).max(axis=0), kept.problem.limits.effort_upper, rtol=1e-6
    )  # as the verdict's own tolerance
    assert [one.name for one in kept.decides] == [one.name for one in lesser.decides]
    for name in ("payload_mass", "effort_upper", "effort_lower", "velocity"):
        # Multipliers of arcs are solved to 1e-6 of the largest.
        own, other = (np.asarray(getattr(solution.sensitivities(), name)) for solution in (kept, lesser))
        np.testing.assert_allclose(own, other, rtol=1e-4, atol=1e-6 * max(1.0, np.abs(other).max()))


@pytest.mark.parametrize(("reserve", "duration"), [(0.05, 0.2158), (0.1, 0.2214), (0.2, 0.2339), (0.3, 0.2490)])
def test_measured_durations_of_rr(reserve, duration):
    # Measured with limits of (1 - r) 3 N m by a prototype, printed with four digits.
    assert solve(paper_problem("rr", reserve=reserve)).duration == pytest.approx(duration, abs=6e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("reserve", "duration"), [(0.05, 0.2313), (0.1, 0.2373), (0.2, 0.2511), (0.3, 0.2679)])
def test_measured_durations_of_rrr(reserve, duration):
    # The same of RRR within ±π. The search is none that proves: it may find a faster one than was known.
    assert solve(paper_problem("rrr", reserve=reserve)).duration <= duration + 6e-5


def test_asymmetrical_limits():
    given = ([-2.0, -3.0], [3.0, 2.5])
    kept = solve(paper_problem("rr", effort_limit=given, reserve=[0.1, 0.2]))
    lesser = solve(paper_problem("rr", effort_limit=([-1.8, -2.4], [2.7, 2.0])))
    assert kept.duration == pytest.approx(lesser.duration, rel=SAME)


def test_the_lower_bound_is_of_the_remaining_limits():
    kept = lower_bound(paper_problem("r", velocity_limit=5, reserve=0.1, velocity_reserve=0.2))
    lesser = lower_bound(paper_problem("r", effort_limit=2.7, velocity_limit=4))
    # Limits differ by roundings, the bound of a leg of 0.5 s by as little.
    assert kept.duration == pytest.approx(lesser.duration, rel=1e-12)
    assert kept.duration > lower_bound(paper_problem("r", velocity_limit=5)).duration


def test_speed_limited_motions_keep_the_velocity_reserve():
    solution = solve(paper_problem("r", velocity_limit=5, velocity_reserve=0.2))
    assert np.abs(solution.trajectory.v).max() <= 4 * (1 + 1e-6)
    assert solution.duration == pytest.approx(solve(paper_problem("r", velocity_limit=4)).duration, rel=SAME)


def test_optimality_is_that_of_the_remaining_limits():
    solution = solve(paper_problem("rr", reserve=0.1))
    robot = solution.problem.robot
    kept = time_optimality(robot, solution.trajectory, reserve=0.1)
    assert kept.ratio == pytest.approx(1.0, abs=1e-6)
    assert kept.feasible and np.all(kept.idle < 1e-9)
    whole = time_optimality(robot, solution.trajectory)
    assert whole.ratio == pytest.approx(solution.duration / 0.210671702, rel=1e-6)  # README's duration
    assert not time_optimality(robot, solution.trajectory, reserve=0.2).feasible


def test_the_indirect_method_keeps_it_once():
    kept = solve_indirect(paper_problem("r", reserve=0.1), options=IndirectOptions(bounded=True))
    lesser = solve_indirect(paper_problem("r", effort_limit=2.7), options=IndirectOptions(bounded=True))
    assert kept.success
    assert kept.duration == pytest.approx(lesser.duration, rel=SAME)


def test_continuation_keeps_it():
    problems = [paper_problem("r", mass, reserve=0.1) for mass in (0.0, 0.1006)]
    for problem, solution in zip(problems, continuation(problems), strict=True):
        lesser = ad.MinimumTimeProblem(problem.robot, q_start=POSES["r"][0], q_goal=POSES["r"][1], effort_limit=2.7)
        assert solution.duration == pytest.approx(solve(lesser).duration, rel=SAME)


def test_the_summary_reports_it():
    assert reserve_summary(paper_problem("rr")) is None
    solution = solve(paper_problem("r", reserve=0.1))
    assert minimum_time_summary(solution)["reserve"] == {"effort": [0.1], "velocity": [0.0]}
