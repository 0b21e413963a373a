"""Reserve for feedback, from the command line."""

import pytest

import armdyn as ad
from armdyn.studies import reserve
from cli.command import answer, run_here


def test_mintime_keeps_and_reports_it(tmp_path):
    leave_out = ("--no-figure", "--no-report", "--out", tmp_path)
    kept = answer(run_here("mintime", "r", "--reserve", "0.1", "--velocity-reserve", "0.03", *leave_out, "--json"))
    assert kept["reserve"] == {"effort": [0.1], "velocity": [0.03]}
    lesser = answer(run_here("mintime", "r", "--effort-limit", "2.7", *leave_out, "--json"))
    assert lesser["reserve"] is None
    assert kept["duration"] == pytest.approx(lesser["duration"], rel=1e-7)  # of two solves
    printed = run_here("mintime", "r", "--reserve", "0.1", *leave_out).stdout
    assert "kept for feedback" in printed and "10 % of the torque limits" in " ".join(printed.split())


def test_joint_by_joint(tmp_path):
    leave_out = ("--no-figure", "--no-report", "--out", tmp_path, "--json")
    kept = answer(run_here("mintime", "rr", "--reserve", "0.1,0.3", *leave_out))
    assert kept["reserve"] == {"effort": [0.1, 0.3], "velocity": [0.0, 0.0]}


def test_bound_and_sweep_keep_it(tmp_path):
    bound = ("bound", "r", "--json", "--velocity-limit")
    kept = answer(run_here(*bound, "5", "--velocity-reserve", "0.2"))
    assert kept["bound"] == pytest.approx(answer(run_here(*bound, "4"))["bound"], rel=1e-12)  # limits but for roundings
    swept = ("sweep", "r", "--payload", "0.1", "--no-figure", "--out", tmp_path, "--json")
    kept, lesser = (answer(run_here(*swept, *limit)) for limit in (("--reserve", "0.1"), ("--effort-limit", "2.7")))
    assert kept["reserve"]["effort"] == [0.1]
    assert kept["rows"][0]["duration_s"] == pytest.approx(lesser["rows"][0]["duration_s"], rel=1e-7)


@pytest.mark.parametrize("value", ["1.1", "-0.1", "nan", "0.1,0.1,0.1", "a tenth"])
def test_a_reserve_outside_0_to_1_is_bad_input(value, tmp_path):
    for option in ("--reserve", "--velocity-reserve"):
        refused = answer(run_here("mintime", "rr", f"{option}={value}", "--out", tmp_path, "--json"), 2)
        assert option.strip("-").replace("-", "_") in refused["message"].replace("-", "_")


def test_ctrl_c_before_a_reserve_has_a_motion_begins_no_other_search(tmp_path, monkeypatch):
    stopped = reserve.ReserveCurve((), {}, (), interrupted=True)
    monkeypatch.setattr(ad, "reserve_curve", lambda *_, **__: stopped, raising=False)
    ended = answer(run_here("mintime", "r", "--for-tracking", "--out", tmp_path, "--json"), 130)
    assert ended["status"] == "interrupted" and "duration" not in ended
