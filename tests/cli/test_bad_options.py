"""Typing mistakes: exit code 2 and a message, before anything is solved."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import armdyn as ad
from cli.command import answer, app, run_here

POSES = ["--q-start", "--q-goal", "--via"]
RESERVES = ["--reserve", "--velocity-reserve"]
MORE = ["--lock", "--arm", "--goal-pose", "--obstacle", "--limit", "--clearance", "--starts", "--time-limit", "--seed"]
JOINTS = ["--effort-limit", "--damping", "--friction", "--friction-width", "--torque-speed", "--armature"]
JOINTS += ["--rotor-inertia", "--gear-ratio"]
WRONG = ("nan", "x", ",", "½")
"""No option of numbers takes one of these."""
OPTIONS = {
    "mintime rr": [
        *POSES,
        *JOINTS,
        *RESERVES,
        "--payload",
        "--velocity-limit",
        "--acceleration-limit",
        "--jerk-limit",
        *MORE,
    ],
    "pid rr": [*JOINTS, "--q-start", "--q-goal", "--payload", "--gains", "--form", "--duration", "--arrival-rule"],
    "sweep rr": [*RESERVES, "--q-start", "--q-goal", "--payload", "--velocity-limit", "--starts", "--time-limit"],
    "replay rr m.npz": ["--payload", "--slow-motion", "--lock", "--arm"],
    "export m.npz": ["--rate", "--format"],
    "reproduce": ["--only", "--payload", "--arrival-rule"],
    "urdf rr": ["--payload"],
}
EXTREME = [
    ["mintime", "r", "--seed", "-1"],
    ["mintime", "r", "--seed", "9" * 5000],
    ["mintime", "r", "--velocity-limit", "1e-320"],
    ["mintime", "r", "--limit", "tip-speed=1e-320"],
    ["mintime", "r", "--payload", "1e400"],
    ["mintime", "r", "--armature", "1e300"],
    ["mintime", "r", "--q-goal", "1" * 10_000],
    ["mintime", "r", "--payload", "0.1", "--payload-com", "1e308,1e308,1e308"],
    ["mintime", "r", "--obstacle", "box:1e308,1,1@0,0,0"],
    ["pid", "r", "--duration", "1e-320"],
    ["pid", "r", "--duration", "1e-30"],
    ["pid", "r", "--q-start", "1e300"],
    ["pid", "r", "--damping", "1e308"],
    ["pid", "r", "--gains", "1e308,1e308,1e308"],
    ["replay", "rr", "m.npz", "--slow-motion", "0"],
    ["replay", "rr", "m.npz", "--slow-motion", "1e-320"],
    ["replay", "rr", "m.npz", "--slow-motion", "1e300"],
    ["replay", "rr", "far.npz"],
    ["export", "m.npz", "--rate", "0"],
    ["export", "m.npz", "--rate", "-5"],
    ["export", "m.npz", "--rate", "inf"],
    ["export", "m.npz", "--rate", "1e300"],
    ["export", "wild.npz"],
    ["doctor", "9" * 5000],
    ["doctor", "<robot/>"],
    ["doctor", "\0"],
]


@pytest.fixture
def run(tmp_path, monkeypatch):
    """A command, in a folder with motions of RR: one that can be shown, one that cannot, one beyond floats."""
    monkeypatch.chdir(tmp_path)
    rest = np.zeros((2, 2))
    ad.Trajectory([0.0, 1.0], rest, rest, rest).save("m.npz")
    ad.Trajectory([0.0, 1.0], rest + 1e300, rest, rest).save("far.npz")
    ad.Trajectory([0.0, 1.0], rest, rest + 1e308, rest).save("wild.npz")
    return lambda *arguments: CliRunner().invoke(app, arguments)


@pytest.mark.parametrize(
    ("command", "option"), [(command, option) for command, options in OPTIONS.items() for option in options]
)
def test_no_nonsense_is_taken_for_a_number(run, command, option):
    for value in WRONG:
        done = run(*command.split(), f"{option}={value}")
        assert done.exit_code == 2, (option, value, done.output)


@pytest.mark.parametrize("arguments", EXTREME, ids=lambda arguments: " ".join(arguments)[:50])
def test_numbers_out_of_range_are_bad_input(run, arguments):
    done = run(*arguments)
    assert done.exit_code == 2, done.output
    assert "internal error" not in done.output and done.output.strip()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("mintime", "rr", "--starts", "1000000000"), "--starts is 1000000000; it must be at most 100000"),
        (("sweep", "rr", "--payload", "0", "--starts", "100001"), "--starts is 100001; it must be at most 100000"),
        (("monte-carlo", "rr", "--count", str(10**12)), "--count is 1000000000000; it must be at most 1000000"),
        (("mintime", "rr", "--seed", "-1"), "--seed is -1; it must be at least 0"),
        (("export", "motion.csv"), "motion.csv is no .npz file; armdyn export takes the trajectory.npz that armdyn"),
    ],
)
def test_too_large_a_value_is_named_by_its_option(arguments, message, tmp_path):
    done = run_here(*arguments, "--json", "--out", tmp_path)
    assert done.returncode == 2 and json.loads(done.stdout)["message"].startswith(message)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["mintime", "r", "--no-costs"], "--no-costs is about the conditions of --preset"),
        (["mintime", "r", "--clearance", "0.02"], "--clearance is from nothing"),
        (["bound", "r", "--clearance", "0.02"], "--clearance is from nothing"),
        (["identify", "r", "--exciting", "2", "--clearance", "0.02"], "--clearance is from nothing"),
        (["mintime", "r", "--wrap"], "--wrap is about endless joints; all joints of r slide or have position limits"),
        (["mintime", "r", "--gear-ratio", "3"], "give --armature, or --rotor-inertia and --gear-ratio"),
        (["identify", "r", "--exciting", "-3"], "--exciting is -3"),
    ],
)
def test_an_option_without_effect_is_refused(arguments, message):
    assert message in answer(run_here(*arguments, "--json"), 2)["message"]


def test_an_empty_file_is_no_tool(tmp_path):
    (tmp_path / "tool.toml").write_text("")
    done = run_here("mintime", "rr", "--tool", "tool.toml", cwd=tmp_path)
    assert done.returncode == 2 and "has no tool" in done.stderr


def test_words_between_colons_are_no_pictures():
    said = run_here("mintime", "rr", "--require", "gap:abc:").stderr
    assert said == "armdyn: --require gap:abc:: 'abc:' is not a number\n"


def test_a_long_path_is_not_echoed_whole():
    done = run_here("mintime", "rr", "--out", 40 * f"/{250 * 'a'}", "--json")
    assert done.returncode == 2 and len(json.loads(done.stdout)["message"]) < 500
