import pickle

import pytest

from armdyn.errors import UnknownRobotError, did_you_mean

NAMES = ["ur3", "ur5", "ur10", "panda", "panda_collision", "kinova", "a1"]


@pytest.mark.parametrize(
    ("name", "meant"),
    [("ur5e", "ur5"), ("pandaa", "panda"), ("Panda", "panda"), ("collision", "panda_collision"), ("KINOVA", "kinova")],
)
def test_names_that_are_alike(name, meant):
    assert did_you_mean(name, NAMES) == f"; did you mean {meant!r}?"


@pytest.mark.parametrize("name", ["r2d2", "", "a", "x" * 100_000])
def test_names_that_are_not(name):
    assert did_you_mean(name, NAMES) == ""


def test_unknown_robot_in_words():
    error = UnknownRobotError("ur5e", NAMES[:3])
    assert str(error) == "no robot named 'ur5e'; did you mean 'ur5'? Known: ur3, ur5, ur10"
    assert len(str(UnknownRobotError("ur5e", [*NAMES[:3], *map(str, range(20))]))) < 100
    assert str(UnknownRobotError("c3po", ["ur3"])) == "no robot named 'c3po'; known: ur3"
    assert str(UnknownRobotError("c3po", [], "elsewhere perhaps")) == "no robot named 'c3po'; elsewhere perhaps"


def test_unknown_robot_reaches_other_processes():
    error = pickle.loads(pickle.dumps(UnknownRobotError("ur5e", NAMES, "there")))
    assert (error.name, error.known, error.hint) == ("ur5e", tuple(NAMES), "there")
