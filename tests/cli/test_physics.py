"""Friction, payloads and ways round from the command line."""

import numpy as np
import pytest

from cli.command import run_here, run_json
from oracles import joint, two_links

INSIDE = '<axis xyz="0 0 1"/><limit effort="2" velocity="1000"/><dynamics damping="0.1" friction="0.2"/>'  # no gravity
BARE = ("--no-figure", "--no-report")


@pytest.fixture
def turntable(tmp_path):
    """One endless joint with friction, 0.03 kg m² about the vertical."""
    (tmp_path / "arm.urdf").write_text(two_links(joint=joint("turn", "base", "arm", "continuous", INSIDE)))
    return tmp_path


@pytest.mark.slow
def test_a_files_friction_is_applied_unless_disabled(turntable):
    poses = ("--q-start", "0", "--q-goal", "2")
    own = run_json("mintime", "arm.urdf", *BARE, *poses, cwd=turntable)
    assert (own["damping"], own["friction"], own["friction_width"]) == ([0.1], [0.2], 0.05)
    none = run_json("mintime", "arm.urdf", *BARE, *poses, "--damping", "0", "--friction", "0", cwd=turntable)
    assert "damping" not in none
    assert none["duration"] == pytest.approx(2 * np.sqrt(2 * 0.03 / 2), rel=1e-8)
    assert own["duration"] > none["duration"] + 1e-3
    heavy = ("--damping", "0", "--friction", "0", "--armature", "0.06")
    # Three times the inertia.
    assert run_json("mintime", "arm.urdf", *BARE, *poses, *heavy, cwd=turntable)["duration"] == pytest.approx(
        none["duration"] * np.sqrt(3), rel=1e-8
    )


def test_wrap_takes_the_shorter_way(turntable):
    frictionless = (
        "mintime",
        "arm.urdf",
        *BARE,
        "--damping",
        "0",
        "--friction",
        "0",
        "--q-start",
        "3",
        "--q-goal",
        "-3",
    )
    wrapped = run_json(*frictionless, "--wrap", cwd=turntable)
    assert wrapped["duration"] == pytest.approx(2 * np.sqrt((2 * np.pi - 6) * 0.03 / 2), rel=1e-8)
    printed = run_here(*frictionless, cwd=turntable)
    assert printed.returncode == 0
    assert "--wrap" in printed.stdout


def test_a_payload_on_a_link(turntable):
    flags = ("--damping", "0", "--friction", "0", "--payload", "0.5", "--payload-frame", "arm")
    poses = ("--q-start", "0", "--q-goal", "2")
    answer = run_json("mintime", "arm.urdf", *BARE, *poses, *flags, "--payload-com", "0.2,0,1", cwd=turntable)
    # Half a kilogram 0.2 m from the axis.
    assert answer["duration"] == pytest.approx(2 * np.sqrt(2 * (0.03 + 0.5 * 0.2**2) / 2), rel=1e-8)


def test_pid_simulates_the_files_friction(turntable):
    loop = ("pid", "arm.urdf", *BARE, "--form", "torque", "--gains", "2,0,0", "--q-start", "0", "--q-goal", "1")
    # Without any the loop swings for ever; with the file's damping it comes to rest.
    swings = run_json(*loop, "--damping", "0", "--friction", "0", "--duration", "3", cwd=turntable, code=3)
    assert swings["max_real_eigenvalue"] == pytest.approx(0, abs=1e-6)
    assert run_json(*loop, "--friction", "0", "--duration", "6", cwd=turntable)["max_real_eigenvalue"] == pytest.approx(
        -0.1 / (2 * 0.03), rel=1e-6
    )


def test_doctor_names_the_applied_friction(turntable):
    answer = run_json("doctor", "arm.urdf", cwd=turntable)
    assert answer["joints"][0]["damping_applied"] == 0.1
    assert answer["joints"][0]["friction_applied"] == 0.2
    assert "friction is applied (all joints)" in answer["remarks"]  # whatever file it is from
    placeholder = run_json("doctor", "z1")
    assert placeholder["joints"][0]["friction"] == 1.0
    assert placeholder["joints"][0]["friction_applied"] == 0.0
    assert any("--friction urdf" in remark for remark in placeholder["remarks"])


@pytest.mark.parametrize(
    ("flags", "message"),
    [
        (("--payload-frame", "arm"), "--payload KG"),
        (("--friction", "much"), "'much' is not a number"),
        (("--damping", "-1"), "not negative"),
        (("--friction-width", "0"), "must be positive"),
        (("--friction-width", "0.1,0.2"), "--friction-width has shape (2,)"),
        (("--payload", "1", "--payload-com", "1,2"), "three finite numbers"),
        (("--payload", "1", "--payload-frame", "base"), "does not move"),
    ],
)
def test_nonsense_is_exit_2(flags, message, turntable):
    done = run_here("mintime", "arm.urdf", "--q-start", "0", "--q-goal", "1", *flags, cwd=turntable)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
