"""`armdyn mintime --preset`: the controller's conditions, its verdict, and their costs."""

import json

import pytest

from cli.command import answer, run_here

OWN = """name = "own"
joints = 1
[limits]
velocity = 50.0
acceleration = 10.0
[interfaces.position]
rate = 1000
necessary = [{necessary}]
"""
QUICK = ("--search", "quick", "--no-figure", "--no-report")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.toml").write_text(OWN.format(necessary='"velocity", "acceleration"'))
    return tmp_path


def test_the_verdict_and_the_costs(here):
    done = run_here("mintime", "r", "--preset", "own.toml", *QUICK)
    words = " ".join(done.stdout.split())
    assert done.returncode == 0, done.stderr
    assert "controller own, position interface at 1000 Hz: accepted" in words
    assert "velocity: nothing, the motion stays below its limit acceleration: at least" in words
    facts = answer(run_here("mintime", "r", "--preset", "own.toml", *QUICK, "--json"))
    assert facts["controller"]["accepted"] and [one["condition"] for one in facts["controller"]["costs"]] == [
        "velocity", "acceleration",
    ]  # fmt: skip
    kept = json.loads((here / "results" / "mintime-r" / "result.json").read_text())
    assert kept["controller"]["preset"] == "own"
    facts = answer(run_here("mintime", "r", "--preset", "own.toml", "--no-costs", *QUICK, "--json"))
    assert facts["controller"]["costs"] == []


def test_a_motion_that_the_controller_refuses(here):
    """Its acceleration jumps to the limit at both ends, and this controller asks for zero there."""
    (here / "own.toml").write_text(OWN.format(necessary='"acceleration", "zero_acceleration"'))
    facts = answer(run_here("mintime", "r", "--preset", "own.toml", "--no-costs", *QUICK, "--json"), 3)
    assert facts["usable"] and not facts["controller"]["accepted"]
    done = run_here("mintime", "r", "--preset", "own.toml", "--no-costs", *QUICK)
    assert done.returncode == 3 and "refused: zero_acceleration of joint1" in " ".join(done.stdout.split())


def test_wrong_presets(here):
    for arguments, said in {
        ("rr", "--preset", "own.toml"): "preset 'own' has 1 joints, but the robot has 2: joint1, joint2",
        ("r", "--preset", "owns.toml"): "owns.toml: no such file",
        ("r", "--interface", "torque"): "--interface torque is of a preset: give --preset NAME",
        ("r", "--preset", "own.toml", "--interface", "torque"): "no 'torque' interface; it has position",
    }.items():
        assert said in answer(run_here("mintime", *arguments, *QUICK, "--json"), 2)["message"]
    (here / "problem.toml").write_text(
        '[robot]\nname = "r"\n[problem]\nq_start = [0]\nq_goal = [1]\npreset = "own.toml"\n'
    )
    said = answer(run_here("mintime", "problem.toml", "--preset", "own.toml", "--json"), 2)["message"]
    assert "--preset: problem.toml says this itself" in said
    assert answer(run_here("mintime", "problem.toml", "--no-costs", *QUICK, "--json"))["controller"]["accepted"]
