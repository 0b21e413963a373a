"""Costs of a controller's conditions, on one joint whose motion is known in closed form."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.studies.preset_costs import condition_costs

PRESET = """name = "own"
joints = 1
[limits]
velocity = 50.0
acceleration = {acceleration}
torque_rate = 1e6
[interfaces.position]
rate = 1000
necessary = ["velocity", "acceleration"]
recommended = ["torque_rate"]
"""


def solved(tmp_path, acceleration, **more):
    (tmp_path / "own.toml").write_text(PRESET.format(acceleration=acceleration))
    preset = ad.ControllerPreset.read(tmp_path / "own.toml")
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("r"))
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[1.0], preset=preset, **more)
    return ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick"))


@pytest.mark.slow
def test_cost_of_an_acceleration_limit(tmp_path):
    solution = solved(tmp_path, 10.0)
    own = {cost.condition: cost for cost in condition_costs(solution)}
    assert set(own) == {"velocity", "acceleration"}  # the necessary ones
    assert own["velocity"].reason == "the motion stays below its limit" and own["velocity"].cost == 0
    without = ad.solve_minimum_time(solution.problem.variant(preset=solution.problem.preset.without("acceleration")))
    assert own["acceleration"].without == pytest.approx(without.duration, rel=1e-3)
    assert own["acceleration"].cost == pytest.approx(2 * np.sqrt(1 / 10) - without.duration, rel=0.01)
    assert str(own["acceleration"]).startswith("acceleration: at least ") and "without it" in str(own["acceleration"])


def test_a_limit_of_the_robots_own_costs_nothing(tmp_path):
    solution = solved(tmp_path, 10.0, acceleration_limit=10.0)
    (_, acceleration) = condition_costs(solution)
    assert acceleration.reason == "the robot's own limit is as strict" and acceleration.without is None


def test_costs_are_of_a_preset():
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("r"))
    problem = ad.MinimumTimeProblem(robot, q_start=[0.0], q_goal=[1.0])
    with pytest.raises(ProblemError, match="a problem with a preset"):
        condition_costs(ad.solve_minimum_time(problem, ad.MinimumTimeOptions(search="quick")))
