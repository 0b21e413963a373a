"""`armdyn identify`, as a user runs it."""

import numpy as np
import pytest

import armdyn as ad
from cli.command import answer, run_here
from oracles import robot_named
from simulated_logs import simulated_log

RRR = robot_named("rrr")


@pytest.fixture
def log(tmp_path):
    """A log of an arm with payload and friction, as a table."""
    arm = RRR.with_payload(ad.Payload(mass=0.12, com=(0.02, 0, 0))).with_friction(0.02, 0.03)
    own = simulated_log(arm, duration=4.0)
    head = ",".join(["t", *(f"{what}{i}" for what in ("q", "tau") for i in (1, 2, 3))])
    file = tmp_path / "log.csv"
    np.savetxt(file, np.column_stack([own.t, own.q, own.tau]), delimiter=",", header=head, comments="")
    return file


def test_a_payload_is_identified_and_the_arm_is_planned_with(log, tmp_path):
    told = answer(run_here("identify", "rrr", log, "--payload-only", "--out", tmp_path / "x", "--json"))
    assert told["status"] == "identified"
    mass = next(one for one in told["parameters"] if one["name"] == "mass of payload")
    assert mass["measured"] and mass["value"] == pytest.approx(0.12, rel=0.01)
    assert all(
        after <= before for after, before in zip(*(told["torque_errors"][k] for k in ("after", "before")), strict=True)
    )
    (file,) = told["files"]
    motion = answer(run_here("bound", file, "--q-start", "0,0,0", "--q-goal", "1,0,0", "--velocity-limit", 5, "--json"))
    assert motion["bound"] > 0.2 and motion["friction"] != [0, 0, 0]
    said = run_here("identify", "rrr", log, "--out", tmp_path / "y").stdout
    assert "combinations measured" in said and "root mean square" in said


def test_an_exciting_motion_is_written(tmp_path):
    told = answer(run_here("identify", "rrr", "--exciting", 2, "--out", tmp_path, "--json"))
    motion = ad.Trajectory.load(told["files"][0])
    assert motion.duration == pytest.approx(2.0) and not np.any(motion.v[[0, -1]])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "give one LOG or several, or --exciting"),
        (["none.csv"], "no such file"),
        (["log.csv", "--payload-only", "--friction-only"], "give one of them"),
        (["log.csv", "--held-out", "2"], "--held-out is 2"),
        (["--exciting", "0.1"], "0.1 s"),
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
    assert "--lock" in done["message"] and "says this itself" in done["message"]
