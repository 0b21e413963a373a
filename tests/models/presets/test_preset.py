"""Controller presets: the built-in ones, users' files, and refused files."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.models.presets.interface import UNITS
from armdyn.parsing.toml import to_toml

MINE = """
name = "mine"
joints = ["hip", "knee"]

[limits]
velocity = [2.0, 3.0]
jerk = 100.0

[interfaces.position]
rate = 250
necessary = ["velocity"]
recommended = ["jerk"]
"""


@pytest.mark.parametrize("name", ad.ControllerPreset.names())
def test_a_built_in_preset_has_its_sources_and_unpublished_limits(name):
    preset = ad.ControllerPreset.named(name)
    assert preset.name == name and preset.robot and preset.sources and preset.not_public
    assert len(preset.date) == 10 and all(source.startswith("https://") for source in preset.sources)
    for one in preset.interfaces:
        assert set(one.conditions) <= set(UNITS) and one.necessary and one.rate >= 100
        assert not set(one.necessary) & set(one.recommended)


@pytest.mark.parametrize("name", ad.ControllerPreset.names())
def test_a_preset_is_written_and_read_again(name, tmp_path):
    preset = ad.ControllerPreset.named(name)
    file = tmp_path / "preset.toml"
    # Top-level keys come before the tables of a file: they are written as one table's.
    file.write_text(to_toml({"preset": preset.to_table()}).replace("[preset]\n", "", 1))
    assert ad.ControllerPreset.read(file) == preset == pickle.loads(pickle.dumps(preset))


def test_franka_numbers():
    """https://frankaemika.github.io/docs/control_parameters.html"""
    panda, fr3 = (ad.ControllerPreset.named(f"franka-{name}") for name in ("panda", "fr3"))
    assert panda.limit("jerk").tolist() == [7500, 3750, 5000, 6250, 7500, 10000, 10000]
    assert panda.limit("acceleration").tolist() == [15, 7.5, 10, 12.5, 15, 20, 20]
    assert fr3.limit("velocity").tolist() == [2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26]
    assert panda.on("torque").limit("jerk") is None and panda.on("torque").limit("torque_rate").tolist() == [1000] * 7
    # min(2.62, max(0, -0.30 + sqrt(12 (2.7501 - q)))) of joint 1, and its mirror image.
    lower, upper = fr3.taper.at(np.array([2.5, 0, 0, -1.5, 0, 2.5, 0]))
    assert upper[0] == pytest.approx(-0.3 + math.sqrt(12 * 0.2501), abs=1e-12)
    assert lower[0] == pytest.approx(0.3 - math.sqrt(12 * 5.2501), abs=1e-12)
    assert fr3.on("torque").taper is None


def test_numbers_of_the_library_robots():
    """The manufacturers' velocity limits are the URDFs', but for rounding, and those of the CB series' old URDFs."""
    for preset, robot, beyond in (
        ("franka-panda", "panda", 1e-9),
        ("xarm7", "xarm7", 0.01),
        ("kinova-gen2-6dof", "kinova", 1e-6),
    ):
        arm = ad.Robot.from_library(robot)
        own = ad.ControllerPreset.named(preset)
        own.expect_joints(arm.joint_names)
        np.testing.assert_allclose(own.limit("velocity"), arm.limits.velocity, atol=beyond)
        np.testing.assert_allclose(own.limit("torque"), arm.limits.effort_upper)
    ad.ControllerPreset.named("ur5").expect_joints(ad.Robot.from_library("ur5").joint_names)


def test_a_users_file(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text(MINE)
    preset = ad.ControllerPreset.read(file)
    assert preset.interface == "position" and preset.chosen.rate == 250
    assert preset.limit("velocity").tolist() == [2, 3] and preset.limit("jerk").tolist() == [100, 100]
    assert preset.limit("acceleration") is None and preset.limit("position_lower") is None
    assert preset.without("jerk").limit("jerk") is None
    assert repr(preset) == "<ControllerPreset 'mine': 2 joints, position interface at 250 Hz>"
    preset.expect_joints(["left_hip", "left_knee"])


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("velocity = [2.0, 3.0]", "velocity = [2.0]", "line 6: limits.velocity has shape"),
        ("velocity = [2.0, 3.0]", "velocity = [2.0, -3.0]", "line 6: limits.velocity of joint 'knee' is -3.0"),
        ("velocity = [2.0, 3.0]", "velocity = [2.0, nan]", "line 6: limits.velocity of joint 'knee' is nan"),
        ("velocity = [2.0, 3.0]", "speed = 2", "line 6: no key 'speed' in"),
        ("rate = 250", "rate = 0", "interfaces.position.rate is 0 Hz; it must be positive"),
        ("rate = 250", "rate = 1e9", "it must be at most 100000"),
        ("rate = 250", "", "line 9: interfaces.position.rate is missing: commands per second"),
        ('["velocity"]', '["torque"]', "condition 'torque' has no limit: give torque in"),
        ('["velocity"]', '["speed"]', "toml, line 11: condition 'speed' is unknown"),
        ("interfaces.position", "interfaces.effort", "no table 'effort'"),
        ('joints = ["hip", "knee"]', "joints = 0", "line 3: joints is 0; it must be at least 1"),
        ('joints = ["hip", "knee"]', "joints = 1000000000", "it must be at most 64"),
        ('joints = ["hip", "knee"]', 'joints = ["hip", 2]', "it must be a list of texts"),
        ('name = "mine"', "", "name is missing"),
        ('name = "mine"', 'name = "mi\\u001b[31mne"', "it must be one line"),
        ('name = "mine"', 'name = "mine"\ninterface = "torque"', "no 'torque' interface; it has position"),
        ("jerk = 100.0", "position_lower = 1.0\nposition_upper = -1.0\njerk = 1.0", "position_lower of joint"),
        ("[interfaces.position]", "[velocity_taper]\ngain = 1.0\n[interfaces.position]", "velocity_taper has no lower"),
    ],
)  # fmt: skip
def test_faults_of_a_file(tmp_path, old, new, said):
    file = tmp_path / "mine.toml"
    assert old in MINE
    file.write_text(MINE.replace(old, new))
    with pytest.raises(ProblemError, match=r"mine\.toml, line") as error:
        ad.ControllerPreset.read(file)
    assert said in str(error.value)


def test_unknown_names():
    with pytest.raises(ProblemError, match="no controller preset named 'franka-pandas'; did you mean 'franka-panda'"):
        ad.ControllerPreset.named("franka-pandas")
    with pytest.raises(ProblemError, match=r"no controller preset named '\.\./\.\./x'"):
        ad.ControllerPreset.named("../../x")
    with pytest.raises(ProblemError, match="has no 'torque' interface; it has position, velocity"):
        ad.ControllerPreset.named("ur5e", "torque")
    ur5e = ad.ControllerPreset.named("ur5e")
    with pytest.raises(ProblemError, match="has 6 joints, but the robot has 7"):
        ur5e.expect_joints([f"joint{i}" for i in range(7)])
    with pytest.raises(ProblemError, match="the robot has 'joint0' in the place of 'shoulder_pan_joint'"):
        ur5e.expect_joints([f"joint{i}" for i in range(6)])
    with pytest.raises(ProblemError, match="no interface"):
        replace(ur5e, interfaces=())
