"""One controller on many arms: the same in any order, killed and resumed, and its summary."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError, ResultError
from armdyn.studies.plant_study import PlantRow, named
from armdyn.studies.rows import read_rows
from problems import POSES, paper_arm, paper_problem, solve
from toys import row_count

PLANTS = ad.Plants(coulomb=(0.0, 0.06), damping=(0.0, 0.003), start=0.01, seed=11)
NOISY = ad.Loop(noise=2e-5)
SHORT = ad.MonteCarloOptions(count=12, duration=0.6)


def ramped(arm="r", duration=0.3):
    robot = paper_arm(arm)
    return robot, ad.ramp(robot, *POSES[arm], duration)


def study(options=SHORT, **given):
    return ad.monte_carlo(*ramped(), plants=PLANTS, loop=NOISY, options=options, **given)


def made(*settled_times, peak_error=0.1):
    """A study whose rows settle at these times; None: not."""
    question = study(replace(SHORT, count=1)).question
    question = replace(question, options=replace(SHORT, count=len(settled_times)))
    rows = tuple(
        PlantRow(
            k,
            PLANTS.sample(k, 1),
            "settled" if time else "not_settled",
            time,
            0.0,
            peak_error + k,
            0.0,
            0.0,
            None,
            (0.0,),
        )
        for k, time in enumerate(settled_times)
    )
    return ad.MonteCarlo(question, rows)


def test_rows_are_the_same_with_any_number_of_threads_and_arms():
    alone, both = (study(replace(SHORT, workers=workers)).rows for workers in (1, 3))
    assert alone == both
    assert study(replace(SHORT, count=5)).rows == alone[:5]
    assert len({row.settled_time for row in alone}) == 12


def test_a_row_equals_track_on_its_arm():
    robot, reference = ramped()
    result = study()
    sample = PLANTS.sample(7, 1)
    plant = sample.arm(robot)
    loop = replace(NOISY, seed=sample.noise)
    run = ad.track(robot, reference, ad.Lqr(), plant, loop, 0.6, q_start=reference.q[0] + sample.start)
    assert result.rows[7].settled_time == run.settled_time
    assert result.rows[7].peak_error == run.peak_error
    np.testing.assert_array_equal(result.run(7).trajectory.q, run.trajectory.q)
    assert result.plant(7).model_hash == plant.model_hash


def stored(file):
    with read_rows(file) as rows:
        return list(rows.rows())


def test_a_file_is_resumed_and_no_row_is_run_twice(tmp_path):
    file = tmp_path / "rows.sqlite"
    study(replace(SHORT, count=4), file=file)
    before = stored(file)
    messages = []
    result = study(file=file, progress=messages.append)
    assert stored(file)[:4] == before  # with the time that each has taken
    assert result.rows == study().rows
    assert messages[-1].startswith("12 of 12 arms")
    whole = stored(file)
    assert study(replace(SHORT, count=3), file=file).rows == result.rows[:3]
    assert stored(file) == whole
    assert [row["settled_time"] for row in ad.study_table(file)] == [row.settled_time for row in result.rows]


def test_another_question_is_refused(tmp_path):
    file = tmp_path / "rows.sqlite"
    robot, reference = ramped()
    few = replace(SHORT, count=1)

    def ask(controller=None, plants=PLANTS, loop=NOISY, options=few, reference=reference, robot=robot):
        return ad.monte_carlo(robot, reference, controller or ad.Lqr(position=0.05), plants, loop, options, file)

    ask()
    for other, message in (
        ({"controller": ad.Lqr(position=0.1)}, "controller.position is 0.05 there and 0.1 here"),
        ({"controller": ad.Pid()}, 'controller.class is "Lqr" there and "Pid" here'),
        ({"plants": replace(PLANTS, seed=12)}, "plants.seed is 11 there and 12 here"),
        (
            {"plants": replace(PLANTS, payload=(0.7, 1.2))},
            r"plants.payload is \[0.8, 1.2\] there and \[0.7, 1.2\] here",
        ),
        ({"loop": ad.Loop()}, "loop.noise is 2e-05 there and 0.0 here"),
        ({"options": replace(few, tolerance=0.01)}, "tolerance is 0.005 there and 0.01 here"),
        ({"reference": ramped(duration=0.31)[1]}, r"reference is [0-9a-f]{8}… there and [0-9a-f]{8}… here"),
        ({"robot": paper_arm("r", 0.2)}, r"robot.model is [0-9a-f]{8}… there"),
        ({"robot": robot.with_limits(2.0, None)}, r'robot.effort is \["-3", "3"\] there and \["-2", "2"\] here'),
    ):
        with pytest.raises(ResultError, match=message):
            ask(**other)
    ask(options=replace(few, workers=1))


def test_a_row_that_was_changed_is_refused(tmp_path):
    file = tmp_path / "rows.sqlite"
    study(replace(SHORT, count=2), file=file)
    own = str(PLANTS.sample(1, 1).payload)
    with sqlite3.connect(file) as connection:
        connection.execute("UPDATE rows SET settings = replace(settings, ?, '1.0')", (own,))
    with pytest.raises(ResultError, match="row 1 is not of the arm that this seed draws"):
        study(file=file)


def test_misfits_are_refused_before_there_is_a_file(tmp_path):
    robot, reference = ramped()
    file = tmp_path / "rows.sqlite"
    for given, message in (
        ({"plants": 3}, "plants is 3; it must be a Plants"),
        ({"options": 3}, "options is 3; it must be a MonteCarloOptions"),
        ({"controller": 3}, "controller is 3"),
        ({"robot": paper_arm("rr")}, "the reference has 1 joints; rr has 2"),
        ({"reference": replace(reference, joint_names=("x",))}, "the reference is of joints x; r has, in this order, "),
        ({"robot": ad.Robot.from_spec(ad.ArmSpec.paper("r"))}, "the payload of r, which has none"),
    ):
        with pytest.raises(ProblemError, match=message):
            ad.monte_carlo(**{"robot": robot, "reference": reference, "file": file, **given})
    assert not file.exists()


KILLED = """
import sys
sys.path[:0] = {path!r}
from test_monte_carlo import study, SHORT, replace
print("here", flush=True)
study(replace(SHORT, count=5000), file={file!r})
"""


@pytest.mark.slow
def test_a_killed_and_resumed_study_loses_and_doubles_no_row(tmp_path, monkeypatch):
    file = tmp_path / "rows.sqlite"
    here = Path(__file__)
    code = KILLED.format(path=[str(here.parent), str(here.parents[1])], file=str(file))
    other = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.DEVNULL)
    try:
        until = time.monotonic() + 120
        while row_count(file) <= 40:
            assert other.poll() is None and time.monotonic() < until
            time.sleep(0.005)
        with monkeypatch.context() as at_once:
            at_once.setattr("armdyn.studies.rows._LOCK_TIMEOUT", 0.0)
            with pytest.raises(ResultError, match="another process is at this study"):
                study(file=file)
    finally:
        os.kill(other.pid, signal.SIGKILL)
        other.wait()
    there = row_count(file)
    assert 40 <= there < 5000
    more = max(row.k for row in stored(file)) + 50
    result = study(replace(SHORT, count=more), file=file)
    assert [row.k for row in result.rows] == list(range(more)) and row_count(file) == more
    # The rows of the killed process are those that this one makes of the same arms.
    assert result.rows[::10] == study(replace(SHORT, count=more)).rows[::10]


def test_ctrl_c_leaves_the_rows_so_far(tmp_path):
    file = tmp_path / "rows.sqlite"
    result = study(
        replace(SHORT, count=500, workers=2), file=file, progress=lambda text: signal.raise_signal(signal.SIGINT)
    )
    assert result.interrupted
    assert 1 <= len(result.rows) < 500
    assert row_count(file) == len(result.rows)
    more = len(result.rows) + 5
    assert study(replace(SHORT, count=more), file=file).rows == study(replace(SHORT, count=more)).rows


def test_the_success_rate_has_wilsons_interval():
    result = made(0.2, 0.3, None, 0.4, 0.5)
    for within, settled in ((0.1, 0), (0.3, 2), (0.45, 3), (np.inf, 4)):
        rate = result.success(within)
        n, p, z = 5, settled / 5, 1.959963984540054
        middle, half = p + z**2 / (2 * n), z * np.sqrt(p * (1 - p) / n + z**2 / (4 * n**2))
        assert (rate.settled, rate.count) == (settled, 5)
        # The roots of Wilson's quadratic, rounded in another order.
        np.testing.assert_allclose(
            [rate.low, rate.high], (middle + np.array([-half, half])) / (1 + z**2 / n), atol=1e-12
        )


def test_quantiles_are_those_of_arms_and_infinite_where_these_did_not_settle():
    result = made(0.5, None, 0.2, 0.3, 0.4)
    np.testing.assert_array_equal(result.quantiles((0, 0.2, 0.21, 0.8, 0.81, 1)), [0.2, 0.2, 0.3, 0.5, np.inf, np.inf])
    with pytest.raises(ProblemError, match=r"parts has 1\.5; expected 0 to 1"):
        result.quantiles((1.5,))


def test_the_worst_arm_is_the_last_or_one_that_did_not_settle():
    assert made(0.2, 0.5, 0.3).worst.k == 1
    assert made(0.2, None, 0.3).worst.k == 1
    assert made(None, 0.2, None).worst.k == 2  # which was farther from its reference
    assert made(0.2, None).summary()["settled_time"]["worst"] is None


def test_the_envelope_has_all_runs_within():
    result = study()
    envelope = result.envelope((0.5, 0.25))
    errors = []
    for k in range(12):
        run = result.run(k)
        reference = result.question.reference(run.trajectory.t).q
        errors.append(np.abs(run.trajectory.q - reference))
    # Kept in single precision.
    np.testing.assert_allclose(envelope.high, np.max(errors, axis=0), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(envelope.low, np.min(errors, axis=0), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(envelope.quantiles[1], np.sort(errors, axis=0)[5], rtol=1e-6, atol=1e-9)
    np.testing.assert_array_equal(envelope.parts, [0.25, 0.5])
    assert envelope.t[-1] == pytest.approx(0.6)


def test_an_envelope_of_runs_that_break_off_is_open():
    robot, reference = ramped()
    wild = ad.Pid(ad.PidGains(1e4, 0.0, 300.0), form="computed_torque")
    options = ad.MonteCarloOptions(count=3, duration=3.0)
    result = ad.monte_carlo(robot, reference, wild, ad.Plants(), ad.Loop(saturate=False, delay=20), options)
    assert {row.status for row in result.rows} == {"diverged"}
    assert result.success().settled == 0
    envelope = result.envelope()
    assert np.all(np.isinf(envelope.high[-1]))
    assert np.all(np.isfinite(envelope.high[0]))


@cache
def with_a_reserve():
    return solve(paper_problem("rrr", reserve=0.1))


@pytest.mark.slow
@pytest.mark.parametrize("friction", [{}, {"coulomb": (0.0, 0.06), "damping": (0.0, 0.003)}])
def test_hundreds_of_arms_of_rrr_settle_along_the_fastest_motion_with_a_reserve(friction):
    options = ad.MonteCarloOptions(count=200)
    motion = with_a_reserve().trajectory
    result = ad.monte_carlo(paper_arm("rrr"), motion, plants=ad.Plants(**friction), options=options)
    assert result.success(within=0.40).rate >= 0.99


def test_a_controller_is_named_by_its_numbers():
    assert named(ad.Pid(ad.PidGains(1, 2, (3, 4)))) == {
        "class": "Pid",
        "gains": {"class": "PidGains", "kp": 1.0, "ki": 2.0, "kd": [3.0, 4.0]},
        "form": "torque",
        "feedforward": True,
        "gravity": False,
    }
    with pytest.raises(ResultError, match="make it a dataclass, or give no file"):
        named(object())
