"""Tracking of a motion by a controller, from the command line."""

import json
from dataclasses import replace
from types import SimpleNamespace

import pytest

import armdyn as ad
from armdyn.cli.tracking import track
from cli.command import answer, run_here
from problems import pick_and_place

BARE = ("--no-figure", "--no-report")


@pytest.mark.usefixtures("unrendered")
@pytest.mark.slow
def test_the_fastest_motion_with_the_wrong_payload(tmp_path):
    done = run_here("track", "rr", "--payload", "0.1", "--reserve", "0.2", "--plant-payload", "0.12",
                    "--plant-friction", "0.06", "--json", "--out", tmp_path)  # fmt: skip
    output = answer(done)
    assert output["success"] and output["status"] == "settled"
    assert 0.9 * output["reference_duration"] < output["settled_time"] < 0.5
    motion, reference = (ad.Trajectory.load(tmp_path / f"{name}.npz") for name in ("trajectory", "reference"))
    assert reference.duration == output["reference_duration"]
    assert motion.duration < 1.3 * output["settled_time"]  # the interesting part
    assert {"figure.png", "report.html", "result.json"} <= {path.name for path in tmp_path.iterdir()}
    assert json.loads((tmp_path / "result.json").read_text())["settled_time"] == output["settled_time"]


def test_the_same_in_words(tmp_path):
    done = run_here("track", "rr", "--ramp", "0.5", "--controller", "computed-torque", *BARE, "--out", tmp_path)
    assert done.returncode == 0
    words = " ".join(done.stdout.split())
    assert "tracking with computed-torque" in words and "ms from the reference's end" in words


def test_sampling_that_makes_it_unstable_is_named(tmp_path):
    pid = ("track", "rr", "--ramp", "0.4", "--controller", "pid", "--gains", "30,50,10", *BARE)
    output = answer(run_here(*pid, "--json", "--out", tmp_path), 3)
    assert output["status"] == "not_settled" and "unstable for its sampling" in output["message"]
    assert output["stability"]["slowest_stable_rate"] > 1000
    output = answer(run_here(*pid, "--ideal", "--json", "--out", tmp_path))
    assert output["success"] and "stability" not in output


@pytest.mark.slow
def test_a_run_that_fails_names_its_gains_and_tune(tmp_path):
    pid = ("--controller", "pid", "--gains", "30,50,10")
    for command, given in {
        ("track", "rr", "--ramp", "0.4", *pid): "--gains 30,50,10 --form torque; armdyn tune ROBOT --controller pid",
        (
            "track",
            "rr",
            "--ramp",
            "0.4",
            "--weights",
            "1,0,0",
            "--plant-payload",
            "0.5",
        ): "--weights 1,0,0; armdyn tune ROBOT",
        ("pid", "rr", "--gains", "3,5,1", "--duration", "1"): "--gains 3,5,1 --form acceleration; armdyn tune ROBOT",
    }.items():
        done = run_here(*command, *BARE, "--out", tmp_path)
        assert done.returncode == 3
        assert given in " ".join(done.stdout.split())
    many = ("monte-carlo", "rr", "--ramp", "0.4", *pid, "--count", "2", "--start-error", "0.01", "--no-figure")
    assert "in force --gains 30,50,10" in " ".join(run_here(*many, "--out", tmp_path / "many").stdout.split())


def test_a_saved_motion(tmp_path):
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    motion = ad.ramp(robot, [0.0, 0.0], [0.3, 0.2], 0.3)
    table = tmp_path / "planned.csv"  # another planner's: its torques are inverse dynamics
    table.write_text("t,q1,q2\n" + "\n".join(f"{t},{q[0]},{q[1]}" for t, q in zip(motion.t, motion.q, strict=True)))
    for file in (motion.save(tmp_path / "ramp.npz"), table):
        output = answer(run_here("track", "rr", "--reference", file, *BARE, "--json", "--out", tmp_path / "out"))
        assert output["reference_duration"] == 0.3 and output["peak_error"] < 1e-3


def test_a_reference_of_another_model_is_said(tmp_path):
    loaded = ad.Robot.from_spec(ad.ArmSpec.paper("rr"), payload=ad.Payload(mass=0.1006))
    file = ad.ramp(loaded, [0.0, 0.0], [0.3, 0.2], 0.3).save(tmp_path / "ramp.npz")
    run = ("track", "rr", "--reference", file, *BARE, "--json", "--out", tmp_path / "out")
    (said,) = answer(run_here(*run))["warnings"]
    assert "ramp.npz: was computed for another arm, payload or friction than rr's: give the --payload" in said
    assert not answer(run_here(*run, "--payload", "0.1006"))["warnings"]


@pytest.mark.slow
def test_a_motion_whose_payload_changes(tmp_path):
    motion = pick_and_place()[1]
    motion.save(tmp_path / "cycle.npz")
    run = ("track", "rr", "--reference", tmp_path / "cycle.npz", "--plant-friction", "0.01", "--no-figure")
    output = answer(run_here(*run, "--no-report", "--json", "--out", tmp_path / "run"))
    assert output["success"] and output["peak_error"] < 0.05
    moved, followed = (ad.Trajectory.load(tmp_path / "run" / f"{name}.npz") for name in ("trajectory", "reference"))
    assert [piece.load for piece in moved.pieces] == [piece.load for piece in motion.pieces] and moved.model_hash == ""
    assert followed.pieces == motion.pieces
    assert not answer(run_here("report", tmp_path / "run", "--json"))["warnings"]
    output = answer(run_here(*run, "--plant-payload", "0.2", "--json", "--out", tmp_path / "run"), 2)
    assert "the pieces of the reference have loads of their own" in output["message"]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (("--controller", "lqg"), "--controller"),
        (("--bandwidth", "50"), "--bandwidth"),
        (("--controller", "pid"), "--gains"),
        (("--controller", "pid", "--gains", "1,2"), "three"),
        (("--ramp", "0.3", "--reference", "x.npz"), "--reference and --ramp"),
        (("--reference", "none.npz"), "none.npz"),
        (("--rate", "0"), "rate"),
        (("--delay", "-1"), "delay"),
        (("--velocity", "guessed"), "velocity"),
        (("--antiwindup", "some"), "antiwindup"),
        (("--noise", "nan"), "noise"),
        (("--ramp", "-1"), "--ramp is -1"),
        (("--ramp", "0.3", "--reserve", "0.1"), "--reserve does not change the motion of --ramp"),
        (("--reference", "none.npz", "--q-goal", "1,1"), "--q-goal does not change the motion of --reference"),
        (("--tolerance", "0"), "tolerance"),
        (("--plant-friction", "-1"), "friction"),
    ],
)
def test_bad_options(given, words, tmp_path):
    output = answer(run_here("track", "rr", *given, *BARE, "--json", "--out", tmp_path), 2)
    assert words in output["message"]


@pytest.mark.slow
def test_mintime_chooses_its_reserve(tmp_path):
    output = answer(run_here("mintime", "rr", "--payload", "0.1", "--for-tracking", "--no-report", "--json",
                           "--out", tmp_path))  # fmt: skip
    best = output["for_tracking"]["best"]
    assert output["reserve"]["effort"] == [best["reserve"]] * 2
    assert output["duration"] == best["duration"] and best["worst"] < output["for_tracking"]["rows"][0]["worst"]
    assert (tmp_path / "reserve.png").stat().st_size > 10_000
    both = answer(run_here("mintime", "rr", "--for-tracking", "--reserve", "0.1", "--json", "--out", tmp_path), 2)
    assert "--reserve" in both["message"]


@pytest.mark.parametrize("command", ["track", "monte-carlo"])
def test_ctrl_c_during_the_search_is_the_end(command, tmp_path, monkeypatch):
    def stopped(problem, *_):
        begun = ad.solve_minimum_time(problem, ad.MinimumTimeOptions(starts=1))
        return replace(begun, status=ad.Status.INTERRUPTED)

    monkeypatch.setattr(
        track, "ad", SimpleNamespace(**{**vars(ad), "solve_minimum_time": stopped, "Status": ad.Status})
    )
    output = answer(run_here(command, "r", "--json", "--out", tmp_path), 130)
    assert output["status"] == "interrupted" and not list(tmp_path.iterdir())
