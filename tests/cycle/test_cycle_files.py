"""Cycles in TOML."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.cycle.cycle_files import locating_steps, read_cycle_file
from armdyn.errors import ProblemError
from cycles import BOLT

FILE = """
[robot]
name = "ur5"

[cycle]
start = "home"
closed = true
velocity_limit = 2.0

[parts.bar]
mass = 1.0
com = [0, 0, 0.05]

[[cycle.obstacles]]
type = "sphere"
center = [0, 0, 2]
radius = 0.1

[[steps]]
move = "over the bin"
to = { position = [0.4, 0.2, 0.3], rpy = [3.1, 0, 0] }
via = [[0, -1.5, 1.5, 0, 0, 0], { position = [0.4, 0.0, 0.4], tolerance = [0.02, 0.02, 0.02, 0, 0, 0] }]
approach = 0.05
retreat = { length = 0.03, axis = "-x", deviation = 0.001 }
speed = 0.25
path_constraints = ["tip-speed=1.5"]

[[steps]]
grasp = "bar"
dwell = 0.2

[[steps]]
wait = 0.5

[[steps]]
release = "bar"
"""


def read(tmp_path, text):
    path = tmp_path / "cell.toml"
    path.write_text(text)
    return ad.read_cycle(path)


def test_a_file_equals_its_python(tmp_path):
    cycle = read(tmp_path, FILE)
    move, grasp, wait, release = cycle.steps
    assert cycle.closed
    assert move.name == "over the bin"
    assert (move.approach.length, move.retreat.length, move.retreat.axis) == (0.05, 0.03, "-x")
    assert move.speed == 0.25
    assert move.path_constraints == (ad.FrameSpeedLimit(1.5),)
    assert isinstance(move.to, ad.GoalPose)
    assert move.to.frame == cycle.robot.tip
    assert move.via[1].tolerance[0] == 0.02
    assert (grasp.part.name, grasp.part.mass, grasp.dwell) == ("bar", 1.0, 0.2)
    assert wait.seconds == 0.5
    assert release.part == grasp.part
    assert cycle.conditions["velocity_limit"] == 2.0
    assert len(cycle.conditions["obstacles"]) == 1
    np.testing.assert_allclose(cycle.start, cycle.robot.pose("home"))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('start = "home"', "", "has no start"),
        ('grasp = "bar"', 'grasp = "barr"', "line 29: grasp is 'barr'; it is a part of .*did you mean 'bar'"),
        ("wait = 0.5", "dwell = 0.5", "line 32: a step has one of move, grasp, release, wait; this one has none"),
        ("wait = 0.5", 'wait = 0.5\nmove = "x"', "has move and wait"),
        ("speed = 0.25", "sped = 0.25", "no key 'sped'.*did you mean 'speed'"),
        ("length = 0.03, ", "", "retreat has no length"),
        ('axis = "-x"', 'axis = "u"', "axis of a straight segment is 'u'"),
        ("mass = 1.0", "mas = 1.0", "no key 'mas'"),
        ("dwell = 0.2", "dwell = -0.2", "line 30: dwell is -0.2 s"),
        ('release = "bar"', "wait = 0", r"line 35: step 4 \(wait\): .*still holds 'bar'"),
        ('grasp = "bar"\ndwell = 0.2', "wait = 0", r"line 34: step 4 \(release\): the arm carries nothing"),
        ("closed = true", "closd = true", "line 7: no key 'closd'"),
        ("[[steps]]", "[steps]", "not TOML|must be an array"),
        ("[cycle]", "[problem]", "line .*is of a problem file, which armdyn mintime"),
    ],
)
def test_a_mistake_is_reported_with_its_line(tmp_path, old, new, said):
    with pytest.raises(ProblemError, match=said):
        read(tmp_path, FILE.replace(old, new, 1))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("mass = 0.1", "mass = 50", r"line 11: step 2 \(grasp bolt\): the arm cannot rest with 'bolt' of 50 kg"),
        ("[1.0, -0.4]", "{ position = [3, 0, 0] }", r"line 14: step 3 \(to the hole\): .* cannot reach its goal pose"),
        (
            "[1.0, -0.4]",
            "[1.0, -0.4]\nvia = [{ position = [3, 0, 0] }]",
            r"line 14: step 3 .*: via\[0\]: frame .* cannot",
        ),
    ],
)
def test_faults_found_by_the_solve_is_reported_with_its_line(tmp_path, old, new, said):
    path = tmp_path / "cell.toml"
    path.write_text(BOLT.replace(old, new, 1))
    read = read_cycle_file(path)
    with pytest.raises(ProblemError, match=said), locating_steps(read.table):
        ad.solve_cycle(read.cycle, read.options)
