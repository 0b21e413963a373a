"""Derivatives of the minimum time from the multipliers, by differences; how much of the time each limit decides."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.verify.costates import Share, deciding
from problems import cart, gantry_problem, luus_problem, paper_problem, solve, solved

STEP = 1e-4
"""Of central differences of numbers good to 1e-10: 1e-6, and the third derivative's share."""


def slope(duration, at):
    return (duration(at + STEP) - duration(at - STEP)) / (2 * STEP)


def test_one_link_by_differences():
    by = solved("r").sensitivities()
    assert by.payload_mass == pytest.approx(slope(lambda m: solve(paper_problem("r", m)).duration, 0.1006), rel=1e-4)
    for side, derivative in ((0, -by.effort_lower[0]), (1, by.effort_upper[0])):

        def duration(limit, side=side):
            limits = ([-3.0], [limit]) if side else ([-limit], [3.0])
            return solve(paper_problem("r", effort_limit=limits)).duration

        assert derivative == pytest.approx(slope(duration, 3.0), rel=1e-4)
    np.testing.assert_array_equal(by.velocity, [0.0])  # its 1000 rad/s are far away


def test_a_velocity_limit_that_holds_by_differences():
    def held(limit):
        return solve(paper_problem("r", velocity_limit=limit))

    by = held(10.0).sensitivities()
    # Both by meshes, which differ by 1e-7 of the duration.
    assert by.velocity[0] == pytest.approx(slope(lambda v: held(v).duration, 10.0), rel=1e-3)
    assert by.velocity[0] < 0


@pytest.mark.slow
def test_two_links_by_differences():
    solution = solved("rr")
    assert solution.certificate.ok, solution.message
    by = solution.sensitivities()
    assert by.payload_mass == pytest.approx(slope(lambda m: solve(paper_problem("rr", m)).duration, 0.1006), rel=1e-3)
    for i in range(2):

        def duration(limit, i=i):
            limits = np.array([3.0, 3.0])
            limits[i] = limit
            return solve(paper_problem("rr", effort_limit=limits)).duration

        assert by.effort()[i] == pytest.approx(slope(duration, 3.0), rel=1e-3)


@pytest.mark.parametrize("arm", ["r", "rr"])
def test_more_torque_is_never_slower_and_more_payload_never_faster(arm):
    by = solved(arm).sensitivities()
    assert by.payload_mass > 0
    assert np.all(by.effort_upper <= 0) and np.all(by.effort_lower >= 0) and np.all(by.effort() < 0)


SHARES = {"velocity limit": 1, "torque limit": 2}
"""The powers of pace that speeds and torques go with."""


def on_the_rail(**limits):
    return ad.MinimumTimeProblem(cart(), q_start=[0.0], q_goal=[2.0], **limits)


def test_torque_alone_decides_by_its_root():
    # t = 2 √(m d / F).
    (share,) = solve(on_the_rail()).decides
    assert (share.limit, share.joint) == ("torque limit", "slide")
    assert share.part == pytest.approx(1 / 2, rel=1e-6)


def test_speed_and_torque_share_the_time():
    # t = d/v + v/a of 2 m, 0.8 m/s, 1 m/s²: −∂ln t/∂ln v = (d/v − v/a)/t, −∂ln t/∂ln F = (v/a)/t.
    speed, torque = solve(on_the_rail(velocity_limit=0.8)).decides
    assert (speed.limit, torque.limit) == ("velocity limit", "torque limit")
    assert speed.part == pytest.approx((2.5 - 0.8) / 3.3, rel=1e-5)
    assert torque.part == pytest.approx(0.8 / 3.3, rel=1e-5)
    assert speed.name == "slide's velocity limit"


def test_a_curve_of_one_step_has_the_shares_of_its_end():
    """The one quadratic program is linearised at the guess, which takes 1.2 times as long: so large was the share."""
    (share,) = solve(on_the_rail(velocity_limit=0.01)).decides
    assert share.limit == "velocity limit" and share.part == pytest.approx(1, rel=2e-4)


@pytest.mark.parametrize("speed", [1.0, np.inf])
def test_without_gravity_the_shares_are_those_of_a_change_of_pace(speed):
    """1 % slower takes speeds 1 % lower and torques 2 %: speed's shares and twice torque's are 1 together."""
    shares = solve(luus_problem().variant(velocity_limit=speed)).decides
    parts = {limit: sum(share.part for share in shares if share.limit == limit) for limit in SHARES}
    assert (parts["velocity limit"] > 0.05) == np.isfinite(speed)
    assert sum(SHARES[limit] * part for limit, part in parts.items()) == pytest.approx(1, rel=1e-5)  # by the mesh


def test_a_lopsided_torque_limit_counts_by_both_its_sides():
    # 1 N forward, 3 N backward: t = √(2 d (1/a + 1/b)); both sides together scale as one limit does.
    (share,) = solve(on_the_rail(effort_limit=([-3.0], [1.0]))).decides
    assert share.part == pytest.approx(1 / 2, rel=1e-6)


def test_who_is_idle_decides_nothing():
    assert {share.joint for share in solve(gantry_problem()).decides} == {"x"}


def test_most_comes_first():
    parts = [share.part for share in solved("rr").decides]
    assert len(parts) == 2 and parts == sorted(parts, reverse=True)


def test_of_the_cost_of_effort_nothing_is_said():
    solution = solved("r")
    assert deciding(solution.problem.variant(effort_weight=1.0), solution.costates, 1e-6) == ()
    assert deciding(paper_problem("r"), solution.costates, 1e-6) == solution.decides


@pytest.mark.parametrize("wrong", [{"limit": 1}, {"joint": None}, {"part": float("nan")}, {"part": "half"}])
def test_a_share_is_a_limit_a_joint_and_a_number(wrong):
    with pytest.raises(ProblemError):
        Share(**{"limit": "torque limit", "joint": "joint1", "part": 0.5} | wrong)
