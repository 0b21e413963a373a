"""Joints without a motor on the command line."""

import pytest

from armdyn.models import Robot
from cli.command import answer, run_here

MOVE = ("--q-start", "0,0", "--q-goal", "1,0")


@pytest.fixture
def stranger(tmp_path):
    """The cart-pole as a file, whose zeros say nothing."""
    path = tmp_path / "cart.urdf"
    path.write_text(Robot.from_library("cart_pole").urdf)
    return path


@pytest.mark.slow
def test_the_fastest_side_move(stranger, tmp_path):
    out = ("--effort-limit", 3, "--no-figure", "--no-report", "--json", "--out", tmp_path / "out")
    data = answer(run_here("mintime", "cart_pole", *MOVE, *out))
    assert data["certified"] and data["duration"] == pytest.approx(1.559332194, rel=1e-8)  # tests/optimal/test_passive
    assert {mode for arc in data["arcs"] for mode in arc["modes"]} == {"torque upper", "torque lower", "passive"}
    same = answer(run_here("mintime", stranger, *MOVE, "--passive", "pole", *out))
    assert same["duration"] == pytest.approx(data["duration"], rel=1e-9)


def test_bound_takes_it_too(stranger):
    asks = ("--velocity-limit", 2, "--json")
    data = answer(run_here("bound", "cart_pole", *MOVE, *asks))
    assert data["bound"] == answer(run_here("bound", stranger, *MOVE, "--passive", "pole", *asks))["bound"]
    assert data["kinematic"] == pytest.approx(0.5) and data["bound"] > 0.6  # the cart must speed up and slow down


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--passive", "pol"), "there is no joint 'pol'; did you mean 'pole'?"),
        (("--passive", "pole", "--passive", "cart"), "no joint has a motor"),
        ((), "name the joint in --passive if it has no motor"),
    ],
)
def test_refusals(stranger, options, words):
    assert words in answer(run_here("mintime", stranger, *MOVE, *options, "--json"), code=2)["message"]


def test_help_teaches():
    data = " ".join(run_here("mintime", "--help").stdout.replace("│", " ").split())
    assert "--passive" in data and "without a motor" in data


def test_doctor_names_them():
    data = answer(run_here("doctor", "acrobot", "--json"))
    assert [joint["passive"] for joint in data["joints"]] == [True, False]
    assert "no motor: other joints swing it (shoulder)" in data["remarks"]
    assert "no motor" in run_here("doctor", "acrobot").stdout


def test_a_controller_of_every_joint_refuses_them(tmp_path):
    data = answer(run_here("pid", "pendubot", *MOVE, "--out", tmp_path / "out", "--json"), code=2)
    assert "there is none at elbow" in data["message"]
