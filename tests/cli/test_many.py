"""`armdyn monte-carlo` and `armdyn tune`: files, continuation, exit codes."""

import json
import re
import signal
import subprocess
import time

import numpy as np
import pytest

import armdyn as ad
from armdyn.studies.rows import read_rows
from cli.command import COMMAND, answer, run_here
from problems import POSES, paper_problem

ARM = ("r", "--payload", "0.1006")
MANY = ("monte-carlo", *ARM, "--ramp", "0.3", "--duration", "0.6", "--friction-range", "0,0.06")
TUNE = ("tune", *ARM, "--ramp-range", "0.2,0.5", "--generations", "2", "--members", "4", "--held-out", "3")


def many(folder, *more, code=0):
    return answer(run_here(*MANY, "--json", "--out", folder, *more), code)


@pytest.mark.slow
def test_a_study_is_written_and_resumed(tmp_path):
    output = many(tmp_path, "--count", 8, "--within", 0.5)
    assert output["success"] is True
    assert (output["count"], output["within"]) == (8, 0.5)
    assert output["success_rate_low"] < output["success_rate"] <= output["success_rate_high"]
    names = ["rows.sqlite", "rows.csv", "reference.npz", "envelope.png", "envelope.pdf", "result.json"]
    assert [file.name for file in map(tmp_path.joinpath, names) if file.exists()] == names
    assert output["files"] == [str(tmp_path / name) for name in names]
    assert json.loads((tmp_path / "result.json").read_text())["settled"] == output["settled"]
    assert ad.Trajectory.load(tmp_path / "reference.npz").duration == pytest.approx(0.3)
    before = ad.study_table(tmp_path / "rows.sqlite")
    assert many(tmp_path, "--count", 10, "--no-figure")["count"] == 10
    after = ad.study_table(tmp_path / "rows.sqlite")
    assert after[:8] == before and len(after) == 10
    assert len((tmp_path / "rows.csv").read_text().splitlines()) == 11


def rows_of(file):
    try:
        with read_rows(file) as rows:
            return len(rows.numbers())
    except ad.ArmdynError:  # there is none yet
        return 0


def test_another_question_is_bad_input(tmp_path):
    many(tmp_path, "--count", 2, "--no-figure")
    output = many(tmp_path, "--count", 2, "--no-figure", "--arms-seed", 1, code=2)
    assert "plants.seed is 0 there and 1 here. Repeat that one, or choose another --out" in output["message"]


def test_fewer_than_are_required_have_an_exit_code(tmp_path):
    more = ("--count", 3, "--no-figure", "--within", "0.001")
    assert many(tmp_path, *more, "--at-least", "50%", code=4)["settled"] == 0
    assert many(tmp_path, *more)["settled"] == 0
    alike = (
        "--payload",
        0,
        "--friction-range",
        "0,0",
        "--out",
        tmp_path / "alike",
        "--count",
        3,
        "--no-figure",
        "--json",
    )
    assert "all 3 arms are the same" in answer(run_here(*MANY, *alike))["warnings"][0]


def test_people_see_how_many_settle(tmp_path):
    done = run_here(*MANY, "--out", tmp_path, "--count", 4, "--no-figure", "--velocity-limit", 5)
    assert done.returncode == 0
    words = " ".join(done.stdout.split())
    assert "r: 4 arms with lqr" in words
    assert "settled within 0.6 s" in words
    assert "95 % interval" in words and not done.stderr
    # The ramp's largest speed is 15/8 of its mean, of the paper's 1.73 rad in 0.3 s.
    assert re.search(r"limits exceeded by 4 of 4 arms, .*: joint1 reaches 21\d\.\d % of its velocity limit", words)
    assert json.loads((tmp_path / "result.json").read_text())["beyond_limits"] == 4


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--friction-range", "1"), "--friction-range: '1' is no pair of numbers; give the least and the greatest"),
        (("--payload-range", "1.2,0.8"), "payload goes from 1.2 to 0.8 times its mass; the least comes first"),
        (("--count", "0"), "count is 0; it must be at least 1"),
        (("--within", "-1"), "--within is -1.0; it must be positive and finite"),
        (("--within", "5"), "--within is 5 s, but arms are simulated for 0.6 s only: --duration"),
        (("--at-least", "95"), "--at-least is 95; it is a part of the arms, 0 to 1 or 0% to 100%"),
    ],
)
def test_ranges_that_are_none_are_bad_input(tmp_path, more, message):
    assert message in many(tmp_path, *more, code=2)["message"]


@pytest.mark.slow
def test_ctrl_c_keeps_the_rows(tmp_path):
    command = [*COMMAND, *MANY, "--count", "100000", "--out", str(tmp_path)]
    study = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    rows, until = tmp_path / "rows.sqlite", time.monotonic() + 120
    while rows_of(rows) <= 5:
        assert study.poll() is None and time.monotonic() < until
        time.sleep(0.01)
    study.send_signal(signal.SIGINT)
    _, output = study.communicate(timeout=60)
    assert study.returncode == 130
    count = rows_of(rows)
    assert f"interrupted; {count} rows are in" in " ".join(output.split())
    count = ad.study_table(rows)[-1]["k"] + 1  # with those that were under way
    assert many(tmp_path, "--count", count, "--no-figure")["count"] == count


@pytest.mark.slow
def test_tune_writes_its_choice(tmp_path):
    output = answer(run_here(*TUNE, "--friction-range", "0,0.06", "--json", "--out", tmp_path))
    assert output["success"] is True
    assert set(output["values"]) == {"kp", "ki", "kd", "ramp"}
    assert (output["training"]["count"], output["held_out"]["count"]) == (6, 3)
    assert output["controller"].startswith("Pid(gains=PidGains(kp=")
    motion = ad.Trajectory.load(tmp_path / "reference.npz")
    assert motion.duration == pytest.approx(output["values"]["ramp"])
    assert json.loads((tmp_path / "result.json").read_text())["values"] == output["values"]


@pytest.mark.slow
def test_tuned_gains_are_run_as_tune_says(tmp_path):
    tuned = " ".join(run_here(*TUNE, "--out", tmp_path).stdout.split())
    best = json.loads((tmp_path / "result.json").read_text())["training"]["settled_time"]
    command = re.search(r"to run it armdyn track … (.*) controllers run", tuned)[1].split()
    run = answer(run_here("track", *ARM, *command, "--no-figure", "--no-report", "--json", "--out", tmp_path))
    assert run["settled_time"] == pytest.approx(best, abs=0.01)  # of the worst of three payloads
    lost = run_here("track", "r", "--controller", "lqr", "--form", "torque", "--json", "--out", tmp_path)
    assert "--form is an option of controller 'pid' alone" in answer(lost, 2)["message"]


@pytest.mark.slow
@pytest.mark.parametrize("option", [("--form", "torque"), ("--per-joint",)])
def test_options_of_another_controller_are_refused(tmp_path, option):
    done = run_here("tune", "rr", "--controller", "lqr", *option, "--json", "--out", tmp_path)
    assert f"{option[0]} is an option of --controller pid, not of lqr" in answer(done, 2)["message"]


@pytest.mark.slow
def test_gains_are_chosen_on_half_of_the_likely_arms_and_one_of_them_is_tracked(tmp_path):
    arms = "".join(f"[[robot.likely]]\npayload = {{ mass = {0.1 + k / 1000} }}\n" for k in range(5))
    file = tmp_path / "identified.toml"
    file.write_text(f"[robot]\nname = 'r'\npayload = {{ mass = 0.1 }}\n{arms}")
    ends = ("--q-start", 0, "--q-goal", 1, "--json", "--out", tmp_path)
    output = answer(run_here("tune", file, *TUNE[4:], *ends))
    assert (output["training"]["count"], output["held_out"]["count"]) == (3, 3)
    track = ("track", file, "--ramp", 0.5, "--no-figure", "--no-report", *ends)
    errors = [
        answer(run_here(*track, *more))["overshoot"] for more in ((), ("--plant-likely", 0), ("--plant-likely", 4))
    ]
    assert errors[0] == errors[1] != errors[2]
    for more, said in (((5,), "--plant-likely is 5; it must be at most 4"), ((1, "--plant-payload", 1), "give one of")):
        assert said in answer(run_here(*track, "--plant-likely", *more), 2)["message"]
    none = ("track", "r", "--ramp", 0.5, "--plant-likely", 0, "--json")
    assert "this one has no likely arms" in answer(run_here(*none), 2)["message"]


@pytest.mark.slow
def test_tune_prints_and_has_an_exit_code_where_arms_do_not_settle(tmp_path):
    file = tmp_path / "problem.toml"
    file.write_text(paper_problem("r", velocity_limit=5.0, velocity_reserve=0.2).to_toml())
    more = ("--duration", "0.6", "--out", tmp_path)
    words = " ".join(run_here("tune", file, *TUNE[4:], "--controller", "computed-torque", *more).stdout.split())
    least = np.ceil(1e4 * 15 / 8 * np.abs(np.subtract(*POSES["r"])).max() / 5) / 1e4  # the quintic's largest speed
    assert ", 3 exceed velocity or position limits" in words
    assert f"from {least:.4f} s on a ramp exceeds none: --ramp-range {least:.4f},2" in words
    assert "r: computed-torque, tuned" in words
    assert "to run it ComputedTorque(bandwidth=" in words
    unsettled = run_here(*TUNE, "--tolerance", "1e-9", "--out", tmp_path, "--json")
    assert answer(unsettled, 3)["training"]["settled_time"] is None
    assert "--controller is 'best'" in answer(run_here(*TUNE, "--controller", "best", "--json"), 2)["message"]
