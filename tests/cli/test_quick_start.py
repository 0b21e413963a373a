"""What the command line does not load before it must, told by modules rather than by the clock."""

import os
import subprocess
import sys

import pytest

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


def loaded(*arguments, **environment):
    """The modules that a command has loaded when it ends, and what it has said."""
    done = subprocess.run(
        [sys.executable, "-c", SPY, *arguments],
        capture_output=True, text=True, check=False, env={**os.environ, **environment},
    )  # fmt: skip
    return set(done.stderr.split()), done.stdout


@pytest.mark.parametrize(
    "arguments",
    [
        ("--version",),
        ("--help",),
        *(
            (command, "--help")
            for command in (
                "mintime",
                "bound",
                "pid",
                "sweep",
                "report",
                "compare",
                "replay",
                "export",
                "reproduce",
                "urdf",
                "doctor",
            )
        ),
        ("mintime",),
        ("mintime", "rr", "--no-such-option"),
    ],
    ids=" ".join,
)
def test_help_and_version_do_without_the_sciences(arguments):
    there, _ = loaded(*arguments)
    assert "typer" in there
    assert not there & set(HEAVY)


def test_version_does_without_rich():
    there, said = loaded("--version")
    assert said.startswith("armdyn ")
    assert "rich" not in there


def test_completion_does_without_the_sciences():
    there, said = loaded(_ARMDYN_COMPLETE="complete_bash", COMP_WORDS="armdyn mintime --pay", COMP_CWORD="2")
    assert said.split() == ["--payload", "--payload-frame", "--payload-com", "--payload-shape"]
    assert not there & set(HEAVY)


def test_a_robot_is_looked_at_without_the_solver():
    there, _ = loaded("doctor", "panda", "--json")
    assert "pinocchio" in there
    assert not there & {"scipy.integrate", "scipy.optimize", "matplotlib", "meshcat"}


def test_without_figure_and_replay_nothing_that_draws_is_loaded(tmp_path):
    there, _ = loaded("pid", "r", "--duration", "0.1", "--no-figure", "--no-report", "--json", "--out", str(tmp_path))
    assert "scipy.optimize" in there
    assert not there & {"matplotlib", "meshcat"}
    assert {file.name for file in tmp_path.iterdir()} == {"trajectory.npz", "result.json"}
