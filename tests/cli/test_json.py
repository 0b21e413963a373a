"""Every key of every command's JSON stands in docs/json.md, and the schema in every object."""

import json
import re
from pathlib import Path

import pytest

from armdyn.cli.console import SCHEMA
from armdyn.cli.interrupts import _ANSWER
from cli.command import answer, app, run_here

DOCS = (Path(__file__).parents[2] / "docs" / "json.md").read_text()
SECTIONS = {part.partition("\n")[0]: part for part in DOCS.split("\n## ")[1:]}
COMMANDS = [command.callback.__name__.replace("_", "-") for command in app.registered_commands]

SHORT = {
    "bound": ["panda", "--q-start", "ready", "--q-goal", "0,0,0,-1,0,1,0", "--damping", "0.1"],
    "track": ["rr", "--ramp", "0.4", "--duration", "0.5", "--no-figure", "--no-report"],
    "monte-carlo": ["r", "--ramp", "0.5", "--duration", "0.8", "--count", "3", "--no-figure"],
    "pid": ["r", "--duration", "0.5", "--no-figure", "--no-report"],
    "export": ["motion.npz"],
    "replay": ["r", "motion.npz"],
    "urdf": ["rr"],
    "doctor": ["rr", "--policy"],
    "robots": ["panda"],
    "presets": [],
    "identify": ["rrr", "--exciting", "1", "--out", "here"],
    "check": ["motion.npz", "--preset", "one.toml"],
    "cycle": ["cycle.toml", "--no-figure", "--no-report"],
}
LONG = {
    "mintime": ["rr", "--search", "quick", "--no-figure", "--no-report", "--obstacle", "sphere:0.02@0.4,0,0.2"],
    "sweep": ["r", "--payload", "0,0.1", "--no-figure"],
    "optimality": ["r", "ramp.npz", "--no-figure", "--no-report", "--search", "quick"],
    "tune": ["r", "--ramp-range", "0.4,0.6", "--generations", "1", "--members", "2", "--held-out", "2"],
    "reproduce": ["--only", "example4", "--payload", "0.1006"],
}


def documented(command):
    """Keys of a section's table, and those that its descriptions name as parts of them."""
    rows = [line.split("|") for line in SECTIONS[command].splitlines() if line.startswith("| `")]
    parts = {re.findall(r"`([^`]+)`", row[1])[0]: re.findall(r"`([^`]+)`", "|".join(row[2:])) for row in rows}
    return {key for row in rows for key in re.findall(r"`([^`]+)`", row[1])}, parts


EVERY = documented("Every command")[0]


def check(command, facts):
    assert facts["schema"] == SCHEMA and facts["command"] == command
    keys, parts = documented(command)
    assert {"success", "status", "warnings"} <= set(facts)
    assert set(facts) <= keys | EVERY
    for key, inside in parts.items():
        found = facts.get(key)
        found = found[0] if isinstance(found, list) and found else found
        if isinstance(found, dict) and key not in ("poses", "cases", "stability", "values", "on_no_limit"):
            assert set(found) <= set(inside), key


def test_every_command_has_a_section():
    assert set(SECTIONS) == {"Every command", *COMMANDS}
    assert SCHEMA in DOCS and json.loads(_ANSWER.replace("MESSAGE", '""'))["schema"] == SCHEMA


@pytest.fixture
def here(tmp_path, monkeypatch):
    import armdyn as ad

    monkeypatch.chdir(tmp_path)
    ends = [[0.0], [1.0]]
    ad.Trajectory(t=[0.0, 1.0], q=ends, v=[[0.0], [0.0]], tau=[[0.0], [0.0]], joint_names=("joint1",)).save(
        "motion.npz"
    )
    Path("one.toml").write_text(
        'name = "one"\njoints = 1\n[limits]\nvelocity = 9.0\n[interfaces.position]\nrate = 9\nnecessary = ["velocity"]'
    )
    Path("cycle.toml").write_text(
        '[robot]\nname = "r"\n[cycle]\nstart = [0.1]\n[parts.bolt]\nmass = 0.1\n[[steps]]\ngrasp = "bolt"\n'
        '[[steps]]\nmove = "there"\nto = [1.0]\n[options]\nsearch = "quick"'
    )
    ad.ramp(ad.Robot.from_spec(ad.ArmSpec.paper("r")), [0.0], [1.0], 1.0).save("ramp.npz")


@pytest.mark.parametrize("command", SHORT)
def test_keys_are_documented(command, here):
    done = run_here(command, *SHORT[command], "--json")
    assert done.returncode in (0, 3), done.stderr
    check(command, json.loads(done.stdout))


@pytest.mark.slow
@pytest.mark.parametrize("command", LONG)
def test_keys_of_longer_commands_are_documented(command, here):
    done = run_here(command, *LONG[command], "--json")
    assert done.returncode in (0, 3), done.stderr
    check(command, json.loads(done.stdout))


@pytest.mark.slow
def test_keys_of_the_list_of_robots_are_documented(listed):
    check("robots", listed)


@pytest.mark.parametrize("command", sorted({*COMMANDS} - {"reproduce", "export", "urdf"}))
def test_bad_input_has_the_same_head(command, here):
    given = ["no_such_robot", *(["motion.npz"] if command in ("replay", "optimality") else [])]
    given += ["--preset", "ur5e"] if command == "check" else []
    facts = answer(run_here(command, *given, "--json"), 2)
    assert list(facts)[:2] == ["schema", "command"]
    assert (facts["success"], facts["status"], facts["command"]) == (False, "bad_input", command)


def test_every_command_speaks_json_and_can_be_quiet():
    for command in COMMANDS:
        words = run_here(command, "--help").stdout
        assert "--json" in words and "--quiet" in words, command


def test_quiet_says_nothing_but_errors(here):
    done = run_here("urdf", "rr", "--out", "here", "--quiet")
    assert (done.returncode, done.stdout) == (0, "") and Path("here").is_dir()
    assert run_here("doctor", "rr", "--quiet").stdout == ""
    done = run_here("doctor", "ur5e", "--quiet")
    assert done.returncode == 2 and done.stdout == "" and "did you mean 'ur5'" in done.stderr
    assert "rr" in run_here("doctor", "rr").stdout  # only that one command was


def test_quiet_json_is_json(here):
    assert answer(run_here("doctor", "rr", "--quiet", "--json"))["status"] == "read"
