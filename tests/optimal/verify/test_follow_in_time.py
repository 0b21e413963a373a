"""The replay of a curve counts in the time limit."""

import time

import pytest

import armdyn as ad


@pytest.mark.slow
def test_minutes_of_motion_are_not_replayed_for_minutes():
    """A Panda at a five thousandth of its speed: 2315 s, whose replay takes minutes."""
    robot = ad.Robot.from_library("panda")
    problem = ad.MinimumTimeProblem(
        robot, q_start="ready", q_goal=[1.0, 0.3, 0.4, -1.2, 0.5, 2.0, 0.0], velocity_limit=0.0005
    )
    begun, progress = time.perf_counter(), []
    options = ad.MinimumTimeOptions(time_limit=2.0, bound=False)
    solution = ad.solve_minimum_time(problem, options, progress=progress.append)
    assert solution.status is ad.Status.TIME_LIMIT and not solution.usable
    assert progress[-1].startswith("replaying a motion of 231")
    assert time.perf_counter() - begun < 12.0
