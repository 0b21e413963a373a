"""Limits so low that no motion is worth a search are refused at once."""

import pytest

import armdyn as ad
from armdyn.errors import ProblemError


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        (
            {"velocity_limit": 1e-9},
            r"velocity limit 1e-09 rad/s: its way of 0.4 rad takes 4e\+08 s .*`velocity_limit` of 0.00011",
        ),
        (
            {"acceleration_limit": 1e-9},
            r"acceleration limit 1e-09 rad/s²: .* takes 4e\+04 s .*`acceleration_limit` of 1.2e-07",
        ),
        ({"jerk_limit": 1e-12}, r"jerk limit 1e-12 rad/s³: .*`jerk_limit` of 2.7e-10 rad/s³ or more"),
    ],
)
def test_limits_that_let_no_motion_take_less_than_an_hour_are_refused(limits, said):
    robot = ad.Robot.from_library("ur5")
    problem = ad.MinimumTimeProblem(robot, q_start=[0.1] * 6, q_goal=[0.5] * 6, **limits)
    with pytest.raises(ProblemError, match=said):
        ad.solve_minimum_time(problem)
