"""`armdyn bound`, as a user runs it."""

import numpy as np
import pytest

from cli.command import answer, run_here


def test_bound_reports_the_duration_and_the_deciding_joint():
    output = answer(run_here("bound", "r", "--velocity-limit", 5, "--payload", 0.1006, "--json"))
    assert 0.99 * 0.368482508 < output["bound"] <= 0.368482508  # the fastest motion
    assert output["joint"] == "joint1"
    assert output["ramps"] == pytest.approx(output["bound"] - output["kinematic"])
    said = run_here("bound", "r", "--velocity-limit", 5, "--payload", 0.1006).stdout
    assert "no motion is faster than" in said and "speed limit of joint1" in said


def test_without_velocity_limits_there_is_none_and_that_is_no_error():
    output = answer(run_here("bound", "rr", "--velocity-limit", "inf", "--json"))
    assert output["bound"] is None
    done = run_here("bound", "rr", "--velocity-limit", "inf")
    assert done.returncode == 0 and "--velocity-limit" in done.stdout


def test_bad_input_is_refused():
    output = answer(run_here("bound", "rr", "--q-goal", "0,0,0", "--json"), code=2)
    assert output["status"] == "bad_input"


def test_of_several_goals_the_nearest_counts():
    asks = ("bound", "double_pendulum_continuous", "--q-start", "0,0", "--q-goal", "5,0.1", "--velocity-limit", 5)
    limits = ("--effort-limit", 2, "--json")
    requested, either = (answer(run_here(*asks, *limits, *more)) for more in ((), ("--wrap",)))
    assert requested["kinematic"] == pytest.approx(1.0)
    assert either["kinematic"] == pytest.approx((2 * np.pi - 5) / 5)
    assert either["kinematic"] < either["bound"] < 1
