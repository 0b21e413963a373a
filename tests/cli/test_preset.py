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


@pytest.mark.slow
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
    """Its acceleration jumps to the limit at both ends, and this controller requires zero there."""
    (here / "own.toml").write_text(OWN.format(necessary='"acceleration", "zero_acceleration"'))
    facts = answer(run_here("mintime", "r", "--preset", "own.toml", "--no-costs", *QUICK, "--json"), 3)
    assert facts["usable"] and not facts["controller"]["accepted"]
    done = run_here("mintime", "r", "--preset", "own.toml", "--no-costs", *QUICK)
    assert done.returncode == 3 and "refused: zero_acceleration of joint1" in " ".join(done.stdout.split())


def test_wrong_presets(here):
    for arguments, said in {
        ("rr", "--preset", "own.toml"): "preset 'own' has 1 joints, but the robot has 2: joint1, joint2",
        ("r", "--preset", "owns.toml"): "owns.toml: no such file",
        ("r", "--interface", "torque"): "--interface torque needs --preset NAME",
        ("r", "--preset", "own.toml", "--interface", "torque"): "no 'torque' interface; it has position",
    }.items():
        assert said in answer(run_here("mintime", *arguments, *QUICK, "--json"), 2)["message"]
    (here / "problem.toml").write_text(
        '[robot]\nname = "r"\n[problem]\nq_start = [0]\nq_goal = [1]\npreset = "own.toml"\n'
    )
    said = answer(run_here("mintime", "problem.toml", "--preset", "own.toml", "--json"), 2)["message"]
    assert "--preset: with a file it is read from the file alone; write it into problem.toml" in said
    assert answer(run_here("mintime", "problem.toml", "--no-costs", *QUICK, "--json"))["controller"]["accepted"]


def test_an_export_is_checked_before_it_is_written(here):
    run_here("mintime", "r", "--preset", "own.toml", "--no-costs", "--out", "run", *QUICK)
    file = "run/trajectory.npz"
    assert "preset of your own, 'own': not checked; give --preset" in " ".join(run_here("export", file).stderr.split())
    kept = answer(run_here("export", file, "--preset", "own.toml", "--json"))
    assert kept["controller"]["accepted"] and kept["status"] == "written" and kept["rate"] == 1000
    # At 20 Hz the quintics between the rows go beyond.
    (here / "run" / "trajectory.json").unlink(missing_ok=True)
    coarse = ("--format", "ros2", "--rate", "20", "--tolerance", "1", "--preset", "own.toml")
    output = answer(run_here("export", file, *coarse, "--json"), 3)
    assert output["status"] == "refused" and output["message"].startswith("not written: own, position interface")
    assert not output["controller"]["accepted"] and not (here / "run" / "trajectory.json").exists()
    words = run_here("export", file, *coarse)
    assert words.returncode == 3 and "not written; without --preset it is" in words.stdout
    assert "controller" not in answer(run_here("export", file, "--format", "ros2", "--json"))  # "own" is a file's


def test_an_export_is_checked_by_the_preset_of_its_run(here):
    result = here / "run" / "result.json"
    run_here("mintime", "r", "--preset", "own.toml", "--no-costs", "--out", "run", *QUICK)
    facts = json.loads(result.read_text())
    # As if it had been planned under a built-in preset, of other joints.
    facts["controller"] |= {"preset": "ur5e", "interface": "velocity"}
    result.write_text(json.dumps(facts))
    assert "preset 'ur5e' has 6 joints" in answer(run_here("export", "run/trajectory.npz", "--json"), 2)["message"]
    facts["controller"] = 3
    result.write_text(json.dumps(facts))
    assert answer(run_here("export", "run/trajectory.npz", "--json"))["success"]


@pytest.mark.slow
def test_a_motion_planned_under_a_preset_is_exported_at_its_rate(here):
    goal = "1,0.2,0.5,-1.5,0.3,2,-0.5"
    facts = answer(
        run_here("mintime", "panda", "--q-start", "ready", "--q-goal", goal, "--preset", "franka-panda", "--out", "run",
                 *QUICK, "--json")
    )  # fmt: skip
    costs = {one["condition"]: one for one in facts["controller"]["costs"]}
    assert facts["controller"]["accepted"] and list(costs) == ["position", "velocity", "acceleration", "jerk"]
    assert costs["acceleration"]["said"].startswith("at least ")
    assert costs["acceleration"]["cost"] > 0.1 and costs["velocity"]["reason"] == "the robot's own limit is as strict"
    for kind in ("csv", "ros2", "panda-python"):
        output = answer(run_here("export", "run/trajectory.npz", "--format", kind, "--json"))
        assert output["controller"]["accepted"] and output["rate"] == 1000
    done = run_here("export", "run/trajectory.npz", "--format", "ros2", "--rate", "100")
    assert done.returncode == 0 and "the controller would refuse trajectory.json" in " ".join(done.stderr.split())
