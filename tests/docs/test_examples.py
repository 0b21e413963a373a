"""The examples that are scripts run, with the expected output."""

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

import armdyn as ad

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.slow
def test_pinocchio_in_casadi(capsys):
    runpy.run_path(str(EXAMPLES / "pinocchio_in_casadi.py"), run_name="__main__")
    printed = capsys.readouterr().out
    off, slopes = map(float, re.search(r"aba: (\S+) .* derivatives: (\S+)", printed).groups())
    assert off < 1e-11 and slopes < 1e-11  # rounding of numbers below 1e3
    assert re.search(r"least torque: cost \d\.\d+, \d+ iterations", printed)
    assert "N m to hold" in printed


def test_goals():
    study = ad.read_study(EXAMPLES / "goals.toml")
    assert len(study) == 625
    assert {axis for axis in study.parameters(0) if axis.startswith("q_goal.")} == {"q_goal.joint1", "q_goal.joint2"}


def test_cell():
    cycle = ad.read_cycle(EXAMPLES / "cell.toml")
    assert [move.name for move in cycle.moves]
    assert cycle.closed and cycle.steps[1].part.mass == 1.0


def test_there_is_no_example_that_no_test_runs():
    tests = "\n".join(path.read_text() for path in Path(__file__).parent.glob("test_*.py"))
    assert not [path.name for path in EXAMPLES.iterdir() if path.is_file() and path.name not in tests]


@pytest.mark.slow
@pytest.mark.parametrize(("file", "seconds"), [("bins.toml", 0.6244), ("shelf.toml", 1.4829)])
def test_cells_take_as_long_as_the_gallery_says(file, seconds):
    problem = ad.read_problem(EXAMPLES / file)
    solution = ad.solve_minimum_time(problem)
    assert solution.usable and solution.clearance.sure
    assert solution.duration == pytest.approx(seconds, rel=1e-3)  # 1e-5 apart with another BLAS
    model = problem.collision_model()
    free = ad.solve_minimum_time(problem.without_obstacles())
    assert np.min(model.distances(free.trajectory(np.linspace(0, free.duration, 200)).q)) < -0.05  # [m]
    assert free.duration < solution.duration
