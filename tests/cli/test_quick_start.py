"""Modules that the command line loads late: tested by loaded modules rather than by the clock."""

import json
import os
import subprocess
import sys

import pytest
from typer.main import get_command

from cli.command import app

HEAVY = (
    "numpy",
    "scipy",
    "casadi",
    "pinocchio",
    "matplotlib",
    "meshcat",
    "yourdfpy",
    "trimesh",
    "lxml",
    "platformdirs",
)
SPY = """import atexit, sys
atexit.register(lambda: print(*sys.modules, file=sys.stderr))
from armdyn.cli import main
sys.argv[0] = "armdyn"
main()"""
SPY_EACH = """import json, sys
from armdyn.cli import main
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["armdyn", *arguments]
    try:
        main()
    except SystemExit:
        pass
    print("\\n" + json.dumps([arguments, list(sys.modules)]), flush=True)"""


def loaded(*arguments, **environment):
    """The modules that a command has loaded when it ends, and its output."""
    done = subprocess.run(
        [sys.executable, "-c", SPY, *arguments],
        capture_output=True, text=True, check=False, env={**os.environ, **environment},
    )  # fmt: skip
    return set(done.stderr.split()), done.stdout


@pytest.mark.slow
def test_help_and_version_do_without_the_sciences():
    """In one process, as the modules of one command stay loaded."""
    commands = [("--version",), ("--help",), ("mintime",), ("mintime", "rr", "--no-such-option")]
    commands += [(name, "--help") for name in get_command(app).commands]
    done = subprocess.run([sys.executable, "-c", SPY_EACH, json.dumps(commands)], capture_output=True, text=True)
    output = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("[[")]
    assert [arguments for arguments, _ in output] == list(map(list, commands)), done.stderr
    assert [arguments for arguments, there in output if "typer" not in there or set(there) & set(HEAVY)] == []


def test_version_does_without_rich():
    there, said = loaded("--version")
    assert said.startswith("armdyn ")
    assert "rich" not in there


def test_completion_does_without_the_sciences():
    there, said = loaded(_ARMDYN_COMPLETE="complete_bash", COMP_WORDS="armdyn mintime --pay", COMP_CWORD="2")
    assert said.split() == ["--payload", "--payload-frame", "--payload-com", "--payload-shape"]
    assert not there & set(HEAVY)


@pytest.mark.slow
def test_a_robot_is_looked_at_without_the_solver():
    there, _ = loaded("doctor", "panda", "--json")
    assert "pinocchio" in there
    assert not there & {"scipy.integrate", "scipy.optimize", "matplotlib", "meshcat"}


@pytest.mark.slow
def test_without_figure_and_replay_nothing_that_draws_is_loaded(tmp_path):
    there, _ = loaded("pid", "r", "--duration", "0.1", "--no-figure", "--no-report", "--json", "--out", str(tmp_path))
    assert "scipy.optimize" in there
    assert not there & {"matplotlib", "meshcat"}
    assert {file.name for file in tmp_path.iterdir()} == {"trajectory.npz", "result.json"}
