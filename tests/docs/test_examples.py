"""The examples that are scripts run, and say what they are to say."""

import re
import runpy
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_pinocchio_in_casadi(capsys):
    runpy.run_path(str(EXAMPLES / "pinocchio_in_casadi.py"), run_name="__main__")
    printed = capsys.readouterr().out
    off, slopes = map(float, re.search(r"aba: (\S+) .* derivatives: (\S+)", printed).groups())
    assert off < 1e-11 and slopes < 1e-11  # rounding of numbers below 1e3
    assert re.search(r"least torque: cost \d\.\d+, \d+ iterations", printed)
    assert "N m to hold" in printed


def test_there_is_no_example_that_no_test_runs():
    tests = "\n".join(path.read_text() for path in Path(__file__).parent.glob("test_*.py"))
    assert not [path.name for path in EXAMPLES.iterdir() if path.is_file() and path.name not in tests]
