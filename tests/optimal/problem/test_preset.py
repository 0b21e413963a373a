"""Problems under a controller preset: its limits, its path constraints, and the preset in problem files."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.optimal.answer.words import checks
from armdyn.parsing.toml import to_toml

PANDA = ad.ControllerPreset.named("franka-panda")
GOAL = [1, 0.2, 0.5, -1.5, 0.3, 2, -0.5]


@pytest.fixture(scope="module")
def panda():
    return ad.Robot.from_library("panda")


def under(robot, preset, **more):
    return ad.MinimumTimeProblem(robot, q_start="ready", q_goal=GOAL, preset=preset, **more)


def test_the_stricter_limit_holds(panda):
    preset = replace(PANDA, limits=replace(PANDA.limits, velocity=(1.0,) * 7, torque=(100.0,) * 6 + (5.0,)))
    problem = under(panda, preset, acceleration_limit=9.0)
    np.testing.assert_array_equal(problem.limits.velocity, np.ones(7))
    np.testing.assert_array_equal(problem.limits.effort_upper, [87, 87, 87, 87, 12, 12, 5])
    np.testing.assert_array_equal(problem.limits.effort_lower, -problem.limits.effort_upper)
    np.testing.assert_array_equal(problem.acceleration_limit, [9, 7.5, 9, 9, 9, 9, 9])
    np.testing.assert_array_equal(problem.jerk_limit, PANDA.limit("jerk"))
    assert problem.path_constraint_names == ("acceleration limits", "jerk limits", "torque-rate limits")
    assert problem.continuous_torque


def test_of_each_interface_its_own_conditions(panda):
    torque = under(panda, PANDA.on("torque"))
    assert torque.acceleration_limit is None and torque.jerk_limit is None
    assert torque.path_constraint_names == ("torque-rate limits",)
    np.testing.assert_array_equal(torque.limits.velocity, panda.limits.velocity)
    bare = under(panda, PANDA.without("torque_rate", "jerk"))
    assert bare.path_constraint_names == ("acceleration limits",) and not bare.continuous_torque


def test_another_preset_takes_its_limits_with_it(panda):
    problem = under(panda, PANDA, jerk_limit=2000.0)
    np.testing.assert_array_equal(problem.variant(preset=None).jerk_limit, np.full(7, 2000.0))
    assert problem.variant(preset=None).acceleration_limit is None
    np.testing.assert_array_equal(problem.variant(preset=PANDA.without("jerk")).jerk_limit, np.full(7, 2000.0))
    np.testing.assert_array_equal(problem.variant(reserve=0.1).acceleration_limit, PANDA.limit("acceleration"))


def test_positions_at_which_the_arm_may_not_rest_are_outside(panda):
    fr3 = ad.ControllerPreset.named("franka-fr3")
    problem = under(panda, fr3)
    # -0.3 + √(12 (2.7501 - q)) is zero at 2.7426, before the position limit of 2.7437.
    assert problem.limits.position_upper[0] == pytest.approx(2.7501 - 0.09 / 12)
    assert "velocity limits by position" in problem.path_constraint_names
    with pytest.raises(ProblemError, match=r"goal of joint 'panda_joint1' .* outside its limits"):
        ad.MinimumTimeProblem(panda, q_start="ready", q_goal=[2.743, *GOAL[1:]], preset=fr3)


def test_other_joints_are_refused(panda):
    with pytest.raises(ProblemError, match="preset 'ur5e' has 6 joints, but the robot has 7: panda_joint1"):
        under(panda, ad.ControllerPreset.named("ur5e"))
    with pytest.raises(ProblemError, match="the robot has 'panda_joint1' in the place of 'joint_1'"):
        under(panda, ad.ControllerPreset.named("kinova-gen3"))
    with pytest.raises(ProblemError, match="preset is 'franka-panda'; it must be a ControllerPreset"):
        under(panda, "franka-panda")


@pytest.mark.parametrize("interface", ["position", "torque"])
def test_a_problem_file_names_the_preset(panda, tmp_path, interface):
    problem = under(panda, PANDA.on(interface), jerk_limit=5000.0)
    text = problem.to_toml()
    assert f'preset = "franka-panda:{interface}"' in text and "acceleration_limit" not in text
    (tmp_path / "problem.toml").write_text(text)
    again = ad.read_problem(tmp_path / "problem.toml")
    assert again.preset == problem.preset
    np.testing.assert_array_equal(again.jerk_limit, problem.jerk_limit)


def test_a_problem_file_has_a_preset_of_ones_own(panda, tmp_path):
    own = PANDA.without("jerk")
    problem = under(panda, own)
    (tmp_path / "problem.toml").write_text(problem.to_toml())
    assert ad.read_problem(tmp_path / "problem.toml").preset == own
    # Or a file next to it.
    (tmp_path / "own.toml").write_text(to_toml({"preset": own.to_table()}).replace("[preset]\n", "", 1))
    named = under(panda, PANDA).to_toml().replace("franka-panda:position", "own.toml")
    (tmp_path / "problem.toml").write_text(named)
    assert ad.read_problem(tmp_path / "problem.toml").preset == own


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ('"franka"', "no controller preset named 'franka'"),
        ('"franka-panda:effort"', "no 'effort' interface"),
        ('"../own.toml"', "own.toml"),
        ("3", "preset is 3"),
        ('{ name = "x", joints = 7, speed = 1 }', "no key 'speed'"),
    ],
)
def test_faults_of_the_preset_of_a_file(panda, tmp_path, value, said):
    text = under(panda, PANDA).to_toml().replace('"franka-panda:position"', value)
    (tmp_path / "problem.toml").write_text(text)
    with pytest.raises(ProblemError, match=r"problem\.toml, line") as error:
        ad.read_problem(tmp_path / "problem.toml")
    assert said in str(error.value)


def test_velocities_that_fall_towards_the_end_of_the_range(tmp_path):
    """One joint: the motion keeps the curve, is accepted, and is slower than without."""
    (tmp_path / "own.toml").write_text(
        'name = "own"\njoints = 1\n[limits]\nvelocity = 4.0\n[velocity_taper]\nlower = -3.0\nupper = 1.6\ngain = 6.0\n'
        'offset = 0.2\n[interfaces.position]\nrate = 1000\nnecessary = ["velocity"]\n'
    )
    preset = ad.ControllerPreset.read(tmp_path / "own.toml")
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("r"))
    quick = ad.MinimumTimeOptions(search="quick")
    problem = ad.MinimumTimeProblem(robot, q_start=[-1.0], q_goal=[1.5], preset=preset)
    tapered = ad.solve_minimum_time(problem, quick)
    constant = ad.solve_minimum_time(
        problem.variant(preset=replace(preset, limits=replace(preset.limits, taper=None))), quick
    )
    assert tapered.usable and preset.check(tapered.trajectory).ok
    assert constant.usable and not preset.check(constant.trajectory).ok
    assert tapered.duration > 1.01 * constant.duration
    motion = tapered.trajectory
    upper = preset.taper.at(motion.q)[1]
    inside = np.abs(motion.q[:, 0] - 1.0) < 0.4
    assert np.max(motion.v[inside] / upper[inside]) == pytest.approx(1, abs=2e-3)  # it goes along the curve
    said = {name: (holds, words) for name, holds, words in checks(tapered)}
    assert said["controller"] == (True, str(preset.check(motion))) and "accepted" in said["controller"][1]
