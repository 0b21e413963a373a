"""`armdyn identify`, as a user runs it."""

import re
from pathlib import Path

import numpy as np
import pytest

import armdyn as ad
from armdyn.cli.app import only_command
from armdyn.models.scene.collision import CollisionModel
from cli.command import answer, run_here
from oracles import robot_named
from simulated_logs import simulated_log

RRR = robot_named("rrr")
LOG = simulated_log(RRR, duration=2.0, velocities=True)
BAD = {what: getattr(LOG, what) for what in ("t", "q", "v", "tau")}


@pytest.fixture
def log(tmp_path):
    """A log of an arm with payload and friction, as a table."""
    arm = RRR.with_payload(ad.Payload(mass=0.12, com=(0.02, 0, 0))).with_friction(0.02, 0.03)
    return table_of(arm, tmp_path)


def table_of(arm, folder):
    """A log of an arm in a file of a folder."""
    own = simulated_log(arm, duration=4.0)
    return written({what: getattr(own, what) for what in ("t", "q", "tau")}, folder)


def written(arrays, folder):
    """A table of arrays by name, in a folder."""
    head = [f"{what}{i}" for what, own in arrays.items() if what != "t" for i in range(1, own.shape[1] + 1)]
    file = folder / "log.csv"
    rows = np.column_stack(list(arrays.values()))
    np.savetxt(file, rows, delimiter=",", header=",".join(["t", *head]), comments="")
    return file


@pytest.mark.slow
def test_a_payload_is_identified_and_the_arm_is_planned_with(log, tmp_path):
    few = ("--likely", 2)  # of each the robot is read again
    facts = answer(run_here("identify", "rrr", log, "--payload-only", *few, "--out", tmp_path / "x", "--json"))
    assert facts["status"] == "identified"
    mass = next(one for one in facts["parameters"] if one["name"] == "mass of payload")
    assert mass["measured"] and mass["value"] == pytest.approx(0.12, rel=0.01)
    assert all(
        after <= before for after, before in zip(*(facts["torque_errors"][k] for k in ("after", "before")), strict=True)
    )
    file, *others = facts["files"]
    assert [Path(one).name for one in others] == ["report.html", "result.json"]
    motion = answer(run_here("bound", file, "--q-start", "0,0,0", "--q-goal", "1,0,0", "--velocity-limit", 5, "--json"))
    assert motion["bound"] > 0.2 and motion["friction"] != [0, 0, 0]
    said = run_here("identify", "rrr", log, *few, "--out", tmp_path / "y").stdout
    assert "combinations measured" in said and "root mean square" in said


@pytest.mark.slow
def test_an_identified_arm_is_planned_with_at_once(tmp_path):
    log = table_of(robot_named("r").with_payload(ad.Payload(mass=0.1)).with_friction(0.02, 0.03), tmp_path)
    ends = ["--q-start", "0", "--q-goal", "1"]
    facts = answer(
        run_here(
            "identify", "r", log, "--payload-only", "--likely", 5, "--out", tmp_path / "x", "--json",
            "--then", "mintime", *ends, "--for-tracking", "--no-figure", "--no-report", "--out", tmp_path / "y",
        )
    )  # fmt: skip
    assert facts["command"] == "mintime" and facts["success"]
    best = facts["for_tracking"]["best"]
    assert best["settled"] == best["arms"] == 5 and best["reserve"] < 0.1
    # The likely arms are in the file: the next command takes them without the log.
    file, ramp = tmp_path / "x" / "identified.toml", ["--ramp", 0.5, "--count", 6, "--no-figure"]
    many = answer(run_here("monte-carlo", file, *ends, *ramp, "--out", tmp_path / "z", "--json"))
    assert many["settled"] == many["count"] == 6 and many["worst"]["payload"] == 1


@pytest.mark.slow
def test_a_payload_that_makes_up_for_wrong_inertias_is_warned_of(tmp_path):
    links = {
        joint: 1.5 * body.toDynamicParameters()
        for joint, body in zip(RRR.joint_names, RRR.model.inertias[1:], strict=True)
    }
    facts = answer(
        run_here(
            "identify",
            "rrr",
            table_of(RRR.with_inertias(links), tmp_path),
            "--payload-only",
            "--likely",
            2,
            "--out",
            tmp_path,
            "--json",
        )
    )
    assert facts["status"] == "identified"
    assert re.fullmatch(r"the logs ask for other inertias .* \(leave out --payload-only\)", facts["warnings"][-1])
    assert "The logs ask for other inertias of the links" in Path(facts["files"][1]).read_text()


@pytest.mark.slow
def test_the_prior_that_a_heavy_payload_takes_is_given_by_options(tmp_path):
    file = table_of(RRR.with_payload(ad.Payload(mass=3.0, com=(0.5, 0, 0))).with_friction(0.02, 0.03), tmp_path)
    command = ("identify", "rrr", file, "--payload-only", "--likely", 0, "--out", tmp_path / "x", "--json")
    unfit = answer(run_here(*command), code=3)
    assert unfit["status"] == "unfit"
    (warning,) = unfit["warnings"]
    assert warning.startswith("do not use this result: torque residuals are ") and warning.endswith(
        "a payload near the true one, with its centre of mass: --payload and --payload-com"
    )
    found = answer(run_here(*command, "--payload", 2, "--payload-com", "0.4,0,0"))
    assert not found["warnings"]
    assert found["parameters"][0]["value"] == pytest.approx(3.0, rel=0.01)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--then", "bnd"], "No such command 'bnd'"),
        (["--then=bnd"], "No such command 'bnd'"),
        (["--then", "mintime", "--q-gaol", "1"], "No such option: --q-gaol"),
        (["--then", "bound '"], "--then: No closing quotation"),
        (["--then", ""], "No such command"),
    ],
)
def test_the_next_command_is_read_before_anything_is_done(tmp_path, words, message):
    done = run_here("identify", "rrr", "none.csv", *words, cwd=tmp_path)
    assert done.returncode == 2 and message in " ".join(done.stderr.split())
    assert only_command(["identify", *words]) == ""  # all commands are at hand


@pytest.mark.slow
def test_the_next_command_runs_only_after_success(log, tmp_path):
    line = ("identify", "rrr", log, "--payload-only", "--out", tmp_path)
    done = answer(run_here("identify", "rrr", "none.csv", "--then", "bound", "--json"), code=2)
    assert done["command"] == "identify" and "no such file" in done["message"]
    done = run_here(*line, "--likely", 0, "--then", "bound --q-start 0,0,0 --q-goal 1,0,0 --velocity-limit 5")
    assert done.returncode == 0 and "identified" in done.stdout and "lower bound" in done.stdout
    assert "[[robot.likely]]" not in (tmp_path / "identified.toml").read_text()


@pytest.mark.slow
def test_the_file_has_as_many_likely_arms_as_can_be_read_again(log, tmp_path, monkeypatch):
    monkeypatch.setattr("armdyn.parsing.toml.MAX_BYTES", 5000)
    facts = answer(run_here("identify", "rrr", log, "--payload-only", "--out", tmp_path, "--json"))
    assert 3 <= facts["likely"] <= 12
    assert (tmp_path / "identified.toml").read_text().count("[[robot.likely]]") == facts["likely"]


JUMP, GAP = np.where(np.arange(2000) < 1000, 0, -0.2), np.where(np.arange(2000) < 1000, 0, 0.5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"q": np.rad2deg(BAD["q"])}, r"velocities are 0.017\d+ times .*: are positions degrees\? .*'q1 \[deg\]'"),
        ({"v": np.rad2deg(BAD["v"])}, r"velocities are 57.\d+ times .*: are velocities degrees\? .*'v1 \[deg/s\]'"),
        ({"v": BAD["v"][:, [1, 0, 2]]}, "velocity of joint1 .* is that of joint2: q and v have different orders"),
        (
            {"tau": BAD["tau"] / 30},
            r"torque of joint1 is 0\.0\d* times that of the arm's weight.* currents",
        ),
        ({"tau": -BAD["tau"]}, "torque of joint1 .*: its sign is opposite"),
        ({"tau": BAD["tau"] * [1, 1, 0]}, "torque of joint3 is constant, 0: its channel is dead"),
        ({"v": BAD["v"] * [0, 1, 1]}, "velocity of joint1 is constant, but the joint moves"),
        ({"t": BAD["t"] + JUMP}, r"row 1001 \(line 1002\): t = 0\.8 s does not rise above the 0.999 s of row 1000"),
        ({"t": BAD["t"] + GAP}, r"a gap of 0.501 s after t = 0.999000 s.* as two logs"),
        ({what: BAD[what][:, :2] for what in ("q", "v", "tau")}, "joint3"),
    ],
)
def test_a_log_that_is_none_of_the_arm_is_refused(changes, message, tmp_path):
    file = written(BAD | changes, tmp_path)
    done = answer(run_here("identify", "rrr", file, "--out", tmp_path, "--json"), code=2)
    assert done["status"] == "bad_input" and re.search(message, done["message"]), done["message"]


def test_an_exciting_motion_is_written(tmp_path):
    facts = answer(run_here("identify", "rrr", "--exciting", 2, "--out", tmp_path, "--json"))
    motion = ad.Trajectory.load(facts["files"][0])
    assert motion.duration == pytest.approx(2.0) and not np.any(motion.v[[0, -1]])


@pytest.mark.slow
def test_an_exciting_motion_is_clear_of_obstacles_and_accepted_by_the_preset(tmp_path):
    scene = ["--obstacle", "plane:0,0,1@0,0,-0.05", "--self-collision", "--clearance", "0.008", "--preset", "ur5"]
    facts = answer(run_here("identify", "ur5", "--exciting", 2, "--payload-only", *scene, "--out", tmp_path, "--json"))
    motion, ur5 = ad.Trajectory.load(facts["files"][0]), robot_named("ur5")
    assert ad.ControllerPreset.named("ur5").check(motion).ok
    model = CollisionModel(ur5, [ad.Plane((0, 0, -0.05), (0, 0, 1))], True)
    assert np.min(model.distances(motion.q)) >= 0.008


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "give one LOG or several, or --exciting"),
        (["none.csv"], "no such file"),
        (["log.csv", "--payload-only", "--friction-only"], "give one of them"),
        (["log.csv", "--held-out", "2"], "--held-out is 2"),
        (["--exciting", "0.1"], "0.1 s"),
        (["log.csv", "--obstacle", "sphere:0.1@1,0,0"], "--obstacle is of a motion to log: give --exciting"),
        (["log.csv", "--preset", "ur5"], "--preset is of a motion to log"),
        (["--exciting", "2", "--then", "mintime", "--q-goal", "1,0,0"], "--then needs an identified arm"),
        (["log.csv", "--likely", "1000"], "--likely is 1000"),
        (["--exciting", "2", "--held-out", "0.3"], "--held-out is of an identification: give a LOG"),
    ],
)
def test_bad_input_is_refused(arguments, message):
    done = answer(run_here("identify", "rrr", *arguments, "--json"), code=2)
    assert done["status"] == "bad_input" and message in done["message"]


def test_a_file_with_a_robot_alone_is_a_robot(tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text("[robot]\nname = 'ur5'\npayload = { mass = 0.5 }\n")
    assert answer(run_here("bound", file, "--q-goal", "1,0,0,0,0,0", "--q-start", "0,0,0,0,0,0", "--json"))["bound"] > 0
    done = answer(run_here("bound", file, "--lock", "elbow_joint=1", "--json"), code=2)
    assert "--lock" in done["message"] and "read from the file alone" in done["message"]
