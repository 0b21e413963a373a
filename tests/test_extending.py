"""What docs/extending.md shows works as it stands there."""

import re
from pathlib import Path

import numpy as np
import pytest

import armdyn as ad
from armdyn.control.laws.registry import CONTROLLERS
from armdyn.errors import TrajectoryError
from armdyn.trajectory.formats import FORMATS
from cli.command import answer, run_here
from problems import paper_arm

DOCS = (Path(__file__).parents[1] / "docs" / "extending.md").read_text()


def shown(section):
    """The names that the Python of a section defines."""
    text = re.search(rf"(?ms)^## {section}\n(.*?)(?=^## |\Z)", DOCS)[1]
    made = {"__name__": "extending"}
    for block in re.findall(r"```python\n(.*?)```", text, re.S):
        exec(block, made)
    return made


@pytest.fixture
def controller():
    """The section about a controller, its registration taken back afterwards."""
    yield shown("A controller")
    del CONTROLLERS["sliding-mode"]


def test_a_controller(controller, tmp_path):
    sliding, run = controller["SlidingMode"](), controller["run"]
    assert run.settled and run.peak_error < 0.01  # with an unknown payload
    robot, motion = paper_arm("rr", 0.1006), controller["motion"]
    exact = ad.track(robot, motion, sliding)
    assert exact.settled and exact.peak_error < 2e-3
    assert ad.sampled_stability(robot, [0.2, 0.0], sliding, ad.Loop()).stable
    bare = ("--no-report", "--no-figure", "--json", "--out", tmp_path)
    told = answer(
        run_here("track", "rr", "--ramp", "0.6", "--controller", "sliding-mode", "--gains", "30,100,2", *bare)
    )
    assert told["success"]
    told = answer(run_here("track", "rr", "--ramp", "0.6", "--controller", "sliding-mode", "--gains", "30", *bare), 2)
    assert "--gains has 1 numbers; give three, SLOPE,GAIN,WIDTH" in told["message"]


@pytest.fixture
def output_format():
    """The section about an output format, its registration taken back afterwards."""
    yield shown("An output format")
    del FORMATS["urscript"]


def test_an_output_format(output_format, tmp_path):
    motion = output_format["motion"]
    samples = motion.resample(125)
    lines = FORMATS["urscript"]().text(samples).splitlines()
    assert lines[0] == "def motion():" and lines[-1] == "end" and len(lines) == samples.t.size + 3
    joints, seconds = re.fullmatch(r"  servoj\((\[.*\]), t=(.*)\)", lines[1]).groups()
    np.testing.assert_array_equal(np.array(eval(joints)), samples.q[0])
    assert float(seconds) == samples.t[1]
    motion.save(tmp_path / "trajectory.npz")
    told = answer(run_here("export", "trajectory.npz", "--format", "urscript", "--rate", "125", "--json", cwd=tmp_path))
    assert told["files"] == ["trajectory.script"]
    assert (tmp_path / "trajectory.script").read_text().splitlines() == lines
    two = ad.ramp(paper_arm("rr"), [0, 0], [1, 1], 1.0)
    with pytest.raises(TrajectoryError, match="the motion has 2 joints; a UR has 6"):
        FORMATS["urscript"]().text(two.resample(125))
