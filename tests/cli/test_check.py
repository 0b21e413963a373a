"""`armdyn check` and `armdyn presets`: files of planners against the conditions of controllers."""

import json

import numpy as np
import pytest

import armdyn as ad
from cli.command import answer, run_here

NAMES = [f"panda_joint{i}" for i in range(1, 8)]


@pytest.fixture(scope="module")
def motion():
    panda = ad.Robot.from_library("panda")
    return ad.ramp(panda, panda.pose("ready"), [1, 0.2, 0.5, -1.5, 0.3, 2, -0.5], 1.0)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def check(*arguments, code=0, preset="franka-panda"):
    return answer(run_here("check", *arguments, "--preset", preset, "--json"), code)


def message(t, q, names, v=None):
    points = [
        {"positions": row.tolist(), "time_from_start": {"sec": int(time), "nanosec": round(1e9 * (time % 1))}}
        | ({} if v is None else {"velocities": speed.tolist()})
        for time, row, speed in zip(t, q, q if v is None else v, strict=True)
    ]
    return json.dumps({"joint_trajectory": {"joint_names": names, "points": points}})


def test_every_format_has_one_answer(motion, here):
    t, q, v, tau = motion.t, motion.q, motion.v, motion.tau
    motion.save(here / "own.npz")
    motion.to_csv(here / "own.csv")
    np.savez(here / "toppra.npz", ts_sample=t, qs_sample=q, qds_sample=v)
    np.savetxt(here / "plain.csv", np.column_stack([t, q, v, tau]), delimiter=",", comments="",
               header="t," + ",".join(f"{what}{i}" for what in ("q", "v", "tau") for i in range(1, 8)))  # fmt: skip
    grip = np.column_stack([q[:, ::-1], 0.04 + 0 * t])
    slow = np.column_stack([v[:, ::-1], 0 * t])
    (here / "moveit.json").write_text(message(t, grip, [*NAMES[::-1], "panda_finger_joint1"], slow))
    for name in ("own.npz", "own.csv", "toppra.npz", "plain.csv"):
        facts = check(name)
        assert facts["accepted"] and facts["status"] == "accepted" and facts["message"].endswith("accepted"), name
        assert facts["files"] == []
        worst = max(row["share"] for row in facts["conditions"] if row["condition"] == "acceleration")
        assert worst == pytest.approx(0.74, abs=0.05), name
    # "joint1" ends the finger's name, too.
    assert "both end in 'joint1'; name the robot" in check("moveit.json", code=2)["message"]
    facts = check("moveit.json", "--robot", "panda")
    assert facts["accepted"] and facts["conditions"][0]["joint"] == "panda_joint1"
    assert {row["condition"] for row in facts["conditions"]} >= {"torque", "torque_rate"}  # by inverse dynamics


def test_positions_of_some_points_are_refused_and_why(motion, here):
    t = np.arange(0, 1.01, 0.1)
    (here / "coarse.json").write_text(message(t, motion(t).q, NAMES))
    done = run_here("check", "coarse.json", "--preset", "franka-panda")
    assert done.returncode == 3
    words = " ".join(done.stdout.split())
    assert "refused: panda_joint" in words and "exceeds its acceleration limit, first at t = 0.001 s: " in words
    assert "Note: the points have positions only: the controller moves straight from one to the next." in words
    assert "not checked, the motion has no torques" in words
    assert check("coarse.json", code=3)["interpolation"] == "linear"
    (here / "coarse.json").write_text(message(t, motion(t).q, NAMES, motion(t).v))
    assert check("coarse.json")["interpolation"] == "cubic"


def test_the_torque_interface_takes_torques(motion, here):
    np.savetxt(here / "no_torques.csv", np.column_stack([motion.t, motion.q, motion.v]), delimiter=",", comments="",
               header="t," + ",".join(f"{what}{i}" for what in ("q", "v") for i in range(1, 8)))  # fmt: skip
    said = check("no_torques.csv", "--interface", "torque", code=2)["message"]
    assert "no torques, which the torque interface takes: --robot ROBOT computes them" in said
    facts = check("no_torques.csv", "--interface", "torque", "--robot", "panda")
    assert facts["accepted"] and {row["condition"] for row in facts["conditions"]} == {"torque_rate", "torque"}
    heavy = check("no_torques.csv", "--interface", "torque", "--robot", "panda", "--payload", "3")

    def most(output):
        return max(abs(row["value"]) for row in output["conditions"] if row["condition"] == "torque")

    assert most(heavy) > most(facts)


def test_refusals(motion, here):
    motion.save(here / "own.npz")
    cases = {
        ("own.npz", "--preset", "ur5e"): "has 6 joints, but the motion has 7",
        ("own.npz", "--preset", "franka"): "no controller preset named 'franka'",
        ("own.npz", "--preset", "none.toml"): "none.toml: no such file",
        ("own.npz", "--preset", "ur5e", "--interface", "torque"): "no 'torque' interface; it has position, velocity",
        ("own.npz", "--preset", "franka-panda", "--robot", "ur5"): "has 7 joints, but the robot has 6",
        ("own.npz", "--preset", "franka-panda", "--payload", "1"): "need --robot",
        ("none.csv", "--preset", "franka-panda"): "none.csv: no such file",
        (".", "--preset", "franka-panda"): "trajectory.npz: no such file",
        ("back.csv", "--preset", "franka-panda"): "row 3 (line 4): t = 0.5 s does not rise above the 1 s",
        ("few.csv", "--preset", "franka-panda"): "at least two increasing times",
        ("six.csv", "--preset", "franka-panda"): "6 columns are q, of 7 joints",
        ("ur.json", "--preset", "franka-panda"): "joint 'joint1' is not among them",
    }
    head = "t," + ",".join(f"q{i}" for i in range(1, 8))
    row = ",".join(["0.1"] * 7)
    (here / "back.csv").write_text(f"{head}\n0,{row}\n1,{row}\n0.5,{row}\n")
    (here / "few.csv").write_text(f"{head}\n0,{row}\n")
    (here / "six.csv").write_text("t,q1,q2,q3,q4,q5,q6\n0,1,1,1,1,1,1\n1,1,1,1,1,1,1\n")
    (here / "ur.json").write_text(message([0.0, 1.0], np.zeros((2, 7)), [f"axis_{i}" for i in range(7)]))
    for arguments, said in cases.items():
        output = answer(run_here("check", *arguments, "--json"), 2)
        assert said in output["message"], (arguments, output["message"])


def test_a_preset_of_ones_own(motion, here):
    motion.save(here / "own.npz")
    (here / "mine.toml").write_text(
        'name = "mine"\njoints = 7\n[limits]\nvelocity = 0.5\n[interfaces.position]\nrate = 100\n'
        'necessary = ["velocity"]\n'
    )
    facts = check("own.npz", preset="mine.toml", code=3)
    assert facts["preset"] == "mine" and facts["rate"] == 100 and facts["conditions"][0]["limit"] == 0.5


def test_presets():
    words = run_here("presets").stdout
    assert all(name in words for name in ad.ControllerPreset.names())
    one = run_here("presets", "franka-fr3").stdout
    for said in ("not public", "sources", "frankaemika.github.io", "2025-01-16", "torque rate", "-2.7437"):
        assert said in one
    assert "joint7   -3.0159    3.0159      5.26            10      5000      12     1000" in one  # within 80 columns
    facts = answer(run_here("presets", "kinova-gen3", "--json"))
    assert facts["presets"][0]["limits"]["position_lower"][0] is None
    assert "did you mean 'ur5e'" in run_here("presets", "ur5ee").stderr


def test_two_points_have_no_torques_but_a_verdict(here):
    (here / "two.csv").write_text("t,q1,q2,q3,q4,q5,q6\n0,0,0,0,0,0,0\n2,0.1,0,0,0,0,0\n")
    facts = check("two.csv", "--robot", "ur5", preset="ur5")
    assert facts["accepted"] and "not checked, the motion has no torques: torque" in facts["notes"]


def test_a_table_in_milliseconds_is_refused_and_one_without_velocities_remarked(motion, here):
    head = "t," + ",".join(f"{what}{i}" for what in ("q", "v") for i in range(1, 8))
    for name, scales in {"ms.csv": (1e3, 1), "still.csv": (1, 0)}.items():
        columns = [scales[0] * motion.t[::10], motion.q[::10], scales[1] * motion.v[::10]]
        np.savetxt(here / name, np.column_stack(columns), delimiter=",", comments="", header=head)
    said = check("ms.csv", code=2)["message"]
    assert "times the derivative of positions: is t in ms? (a table" in said
    found = answer(run_here("check", "still.csv", "--preset", "franka-panda", "--json"), 3)
    assert "all velocities are 0 although positions change" in found["warnings"][0]
