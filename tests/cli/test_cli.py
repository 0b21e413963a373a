"""The command line as a user runs it: a process of its own, its output and its exit code."""

import csv
import json
import os
import signal
import subprocess
import time
from pathlib import Path

import psutil
import pytest

import armdyn as ad
from cli.command import COMMAND, answer, run, run_here, run_json
from problems import CART


@pytest.mark.slow
def test_mintime(tmp_path):
    answer = run_json("mintime", "rr", "--payload", 0.1006, "--out", tmp_path / "run", how=run)
    assert answer["success"] and answer["status"] == "solved"
    assert 0.2106 < answer["duration"] < 0.22
    assert answer["replay_error"] < 1e-3
    assert answer["certified"] and answer["certificate"]["ok"]
    assert sum(arc["duration"] for arc in answer["arcs"]) == pytest.approx(answer["duration"], rel=1e-9)
    assert answer["sensitivities"]["payload_mass"] > 0
    names = {Path(file).name for file in answer["files"]}
    assert names == {"trajectory.npz", "figure.png", "figure.pdf", "report.html", "result.json"}
    assert all(Path(file).stat().st_size > 0 for file in answer["files"])
    trajectory = ad.Trajectory.load(tmp_path / "run" / "trajectory.npz")
    assert trajectory.duration == pytest.approx(answer["duration"], rel=1e-12)
    assert json.loads((tmp_path / "run" / "result.json").read_text())["duration"] == answer["duration"]


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "missing"),
    [
        (["--no-figure"], {"figure.png", "figure.pdf"}),
        (["--no-report"], {"report.html"}),
        (["--no-figure", "--no-report"], {"figure.png", "figure.pdf", "report.html"}),
    ],
)
def test_unwanted_files_are_not_written(options, missing, tmp_path):
    answer = run_json("mintime", "r", *options, "--out", tmp_path)
    written = {"trajectory.npz", "figure.png", "figure.pdf", "report.html", "result.json"} - missing
    assert {Path(file).name for file in answer["files"]} == written == {file.name for file in tmp_path.iterdir()}
    assert set(json.loads((tmp_path / "result.json").read_text())["files"]) == written


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_people_see_the_files_and_the_time(tmp_path):
    words = " ".join(run_here("pid", "r", "--duration", 1, "--no-report", "--out", "here", cwd=tmp_path).stdout.split())
    assert "results here" in words
    assert "written trajectory.npz, figure.png, figure.pdf, result.json in" in words


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_mintime_round_an_obstacle_to_a_pose(tmp_path):
    (tmp_path / "scene.json").write_text('[{"type": "sphere", "center": [0.14, 0, -0.366], "radius": 0.04}]')
    options = ["--payload", 0.1006, "--obstacle", "scene.json", "--goal-pose", "tip:0.4783,0,0.0574"]
    answer = run_json("mintime", "rr", *options, "--out", "run", cwd=tmp_path)
    # The fastest motion to one of the two elbows is clear of the ball: it keeps its certificate.
    assert answer["usable"] and answer["certified"]
    assert answer["clearance"]["distance"] >= 0.005 and answer["clearance"]["other"] == "sphere"
    assert answer["clearance"]["sure"] and len(answer["goals"]) == 2
    assert any(one["said"].endswith("; the clearance is proven at all times") for one in answer["checks"])
    assert "obstacle0" not in (tmp_path / "run" / "result.json").read_text()
    for wrong, says in (
        (["--obstacle", "ball:3"], "no file"),
        (["--obstacle", "box:1,1@0,0,0"], "box:SX,SY,SZ@X,Y,Z"),
        (["--obstacle", "box:0.1"], "box:SX,SY,SZ@X,Y,Z"),
        (["--obstacle", "cube:1@0,0,0"], "sphere:R@X,Y,Z"),
        (["--obstacle", "sphere:0.05@0,0,-0.2"], "inside"),
        (["--goal-pose", "tip:9,0,0"], "cannot reach"),
        (["--goal-pose", "9,0,0"], "FRAME:X,Y,Z"),
        (["--goal-pose", "tip:0.3,0,0.1,0,0,0,1", "--goal-free", "up"], "--goal-free or --goal-tolerance: free is"),
        (["--goal-free", "rz"], "belong to --goal-pose"),
        (["--via", "1"], "via"),
    ):
        done = run_here("mintime", "rr", *wrong, cwd=tmp_path)
        assert done.returncode == 2 and says in " ".join(done.stderr.split()), done.stderr


@pytest.mark.slow
def test_mintime_with_limits_along_the_way(tmp_path):
    limits = ["--limit", "tip-speed=4", "--limit", "torque-rate=200,100", "--no-figure", "--no-report"]
    answer = run_json("mintime", "rr", *limits, "--starts", 2, "--out", "run", cwd=tmp_path)
    assert answer["usable"] and not answer["certified"]
    speed, rate = answer["conditions"]
    assert speed["name"] == "speed of 'tip'" and speed["share"] <= 1 + 1e-3 and "of 4 m/s" in speed["said"]
    assert rate["name"] == "torque-rate limits" and rate["share"] <= 1 + 1e-6
    assert not speed["reasons"] and not rate["reasons"]


def test_mintime_of_a_urdf_file_with_poses_and_limits(tmp_path):
    (tmp_path / "cart.urdf").write_text(CART)
    task = ("cart.urdf", "--q-start", "0", "--q-goal", "-2", "--effort-limit", "4")
    answer = run_json("mintime", *task, "--no-figure", cwd=tmp_path)
    # Four newtons instead of one halve the 2√2 s.
    assert answer["duration"] == pytest.approx(2**0.5, rel=1e-8)
    assert (tmp_path / "results" / "mintime-cart" / "report.html").exists()


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_sweep(tmp_path):
    answer = run_json("sweep", "r", "--payload", "0.2,0.1,0.1", "--out", tmp_path)
    assert answer["success"] and answer["status"] == "done"
    # By exact quadrature: R, 200 g.
    assert [row["payload_kg"] for row in answer["rows"]] == [0.1, 0.2]
    assert answer["rows"][1]["duration_s"] == pytest.approx(0.2114038279, abs=1e-9)
    assert all(row["certified"] and row["limited_most_by"] == "joint1's torque limit" for row in answer["rows"])
    names = {Path(file).name for file in answer["files"]}
    assert names == {"100g.npz", "200g.npz", "sweep.csv", "figure.png", "figure.pdf", "result.json"}
    with (tmp_path / "sweep.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["duration_s"]) for row in rows] == [row["duration_s"] for row in answer["rows"]]
    motion = ad.Trajectory.load(tmp_path / "200g.npz")
    assert motion.duration == pytest.approx(answer["rows"][1]["duration_s"], rel=1e-12) and motion.model_hash
    again = run_json("sweep", "r", "--payload", "0.2,0.1", "--no-figure", "--out", tmp_path)
    assert again["rows"] == answer["rows"]  # with the time that each has taken: nothing was solved again
    answer = run_json("sweep", "r", "--payload", "0.1", "--no-figure", "--out", tmp_path / "bare")
    assert {Path(file).name for file in answer["files"]} == {"100g.npz", "sweep.csv", "result.json"}
    done = run_here("sweep", "panda", cwd=tmp_path)
    assert done.returncode == 2 and "--payload" in done.stderr


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_pid_and_replay_of_both(tmp_path):
    # 4.5535 s: RR_Ex5, reading tip, first joint's last entry into 0.005 rad.
    answer = run_json("pid", "rr", "--payload", 0.1006, "--out", tmp_path)
    assert answer["success"] and answer["arrival_time"] == pytest.approx(4.5535, abs=2e-3)
    assert answer["arrival_rule"] == "last_entry_first_joint"  # the paper's, of its arms
    assert answer["settling_time"] == pytest.approx(5.848, abs=2e-3)
    file = tmp_path / "trajectory.npz"
    page = run_json("replay", "rr", file, file, "--payload", 0.1006, "--out", tmp_path / "both")
    assert Path(page["files"][0]).read_text().count("<script") >= 1


def test_pid_that_never_settles_is_exit_3(tmp_path):
    answer = run_json("pid", "rrr", "--no-figure", "--no-report", "--out", tmp_path, code=3)
    assert not answer["success"] and answer["arrival_time"] is None
    assert answer["max_real_eigenvalue"] > 0


def test_urdf(tmp_path):
    rr = ("urdf", "rr", "--payload", 0.1006)
    text = run_here(*rr).stdout
    (file,) = answer(run_here(*rr, "--out", tmp_path, "--json"))["files"]
    assert Path(file).name == "rr_100.6g.urdf"
    assert Path(file).read_text() == text == answer(run_here(*rr, "--json"))["urdf"]


@pytest.mark.slow
def test_doctor(tmp_path):
    assert run_json("doctor", how=run)["status"] == "healthy"
    answer = run_json("doctor", "panda")
    assert len(answer["joints"]) == 7 and answer["dynamics_error"] < 1e-10
    assert any("locked" in remark for remark in answer["remarks"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["mintime", "nosuch"], "no robot named 'nosuch'"),
        (["mintime", "missing.urdf"], "missing.urdf: no such file"),
        (["mintime", "rr", "--q-goal", "1"], "--q-goal has shape"),
        (["mintime", "rr", "--q-goal", "1,x"], "'x' is not a number"),
        (["mintime", "rr", "--q-goal", "nan,0"], "must be finite"),
        (["mintime", "rr", "--q-goal", "4,0"], "outside its limits"),
        (["mintime", "rr", "--q-start", "0,0", "--q-goal", "0,0"], "same state"),
        (["mintime", "rr", "--payload", "-1"], "payload mass is -1"),
        (["mintime", "rr", "--lock", "joint1=0"], "--lock"),
        (["mintime", "panda"], "give --q-start for panda: 7 positions"),
        (["mintime", "rr", "--starts", "0"], "starts is 0"),
        (["mintime", "rr", "--limit", "tip-sped=0.25"], "did you mean 'tip-speed'?"),
        (["mintime", "rr", "--limit", "tip-speed=0.25@tool0"], "no frame 'tool0'"),
        (["mintime", "rr", "--limit", "torque-rate"], "write torque-rate=R[,R…]"),
        (["mintime", "rr", "--limit", "rms-torque=3@x"], "--limit rms-torque: the dwell after @: 'x' is not a number"),
        (["mintime", "rr", "--limit", "rms-torque=-1"], "--limit rms-torque limit of joint 'joint1' is -1.0 N m"),
        (["mintime", "rr", "--torque-speed", "joint1=0:3,1:4"], "its torque rises beyond speed 0"),
        (["mintime", "rr", "--torque-speed", "joint1=0:3", "--torque-speed", "joint1=0:2"], "'joint1' is given twice"),
        (["pid", "rr", "--gains", "1,2"], "give three"),
        (["pid", "rr", "--form", "magic"], "magic"),
        (["pid", "rr", "--arrival-rule", "soon"], "soon"),
        (["replay", "rr", "missing.npz"], "missing.npz: no such file"),
        (["export", "missing.npz"], "missing.npz: no such file"),
        (["export", "missing.npz", "--format", "xlsx"], "xlsx"),
        (["urdf", "rrrr"], "no planar arm is called 'rrrr'"),
    ],
)
def test_bad_input_is_exit_2_without_traceback(arguments, message, tmp_path):
    done = run_here(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())  # nothing is left behind
    output = answer(run_here(*arguments, "--json", cwd=tmp_path), 2)
    assert output["success"] is False and message in output["message"]


@pytest.mark.slow
def test_bad_input_is_exit_2_of_the_process(tmp_path):
    output = run_json("doctor", "nosuch", code=2, cwd=tmp_path, how=run)
    assert output["success"] is False and "no robot named 'nosuch'" in output["message"]


@pytest.mark.slow
def test_relative_cache_is_exit_2(monkeypatch, tmp_path):
    monkeypatch.setenv("ARMDYN_CACHE", "cache")
    done = run("mintime", "r", "--no-figure", "--no-report", "--out", tmp_path)
    assert (done.returncode, done.stderr) == (2, "armdyn: ARMDYN_CACHE='cache': must be an absolute path\n")


def test_bad_usage_is_exit_2():
    assert run_here("mintime").returncode == 2
    assert run_here("mintime", "rr", "--no-such-option").returncode == 2
    assert run_here("nosuch").returncode == 2


def test_not_converged_is_exit_3(tmp_path):
    answer = run_json("mintime", "rrr", "--time-limit", 0.001, "--no-figure", "--no-report", "--out", tmp_path, code=3)
    assert answer["success"] is False and answer["status"] == "time_limit"
    assert (tmp_path / "trajectory.npz").exists()


@pytest.mark.slow
def test_interrupt_is_exit_130_with_partial_results(tmp_path):
    # With 1 kg no search with this many guesses ends early: it takes minutes.
    arguments = [
        "mintime",
        "rrr",
        "--payload",
        "1",
        "--starts",
        "5000",
        "--out",
        str(tmp_path / "run"),
        "--json",
    ]
    process = subprocess.Popen([*COMMAND, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    searcher = psutil.Process(process.pid)
    while process.poll() is None and searcher.cpu_times().user < 2:  # its start takes one second, its search minutes
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=120)
    assert process.returncode == 130, errors
    assert json.loads(output)["status"] == "interrupted"
    assert "Traceback" not in errors


@pytest.mark.parametrize(
    "command",
    [
        "",
        "mintime",
        "bound",
        "pid",
        "sweep",
        "reproduce",
        "report",
        "compare",
        "replay",
        "export",
        "urdf",
        "robots",
        "identify",
        "doctor",
    ],
)
def test_help_teaches(command):
    done = run_here(*command.split(), "--help")
    assert done.returncode == 0
    if command:
        assert "--json" in done.stdout
    if command in ("mintime", "bound", "pid"):
        assert "[kg]" in done.stdout and "[rad or m]" in " ".join(done.stdout.replace("│", " ").split())


def test_a_refused_pose_is_shown_where_a_folder_is_named(tmp_path):
    options = ["--payload", 0.1, "--obstacle", "plane:-1,0,0@0.45,0,0", "--q-start=-1.5,0", "--q-goal", "0.2,0"]
    result = run_here("mintime", "rr", *options)
    assert result.returncode == 2 and "--out DIR writes a page" in " ".join(result.stderr.split())
    result = run_here("mintime", "rr", *options, "--out", tmp_path)
    assert result.returncode == 2 and [file.name for file in tmp_path.iterdir()] == ["contacts.html"]
