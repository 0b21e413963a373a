"""What docs/extending.md shows works as it stands there."""

import re
from pathlib import Path

import casadi as ca
import coal
import numpy as np
import pytest

import armdyn as ad
from armdyn.cli.options.course import obstacles_of
from armdyn.errors import ProblemError
from armdyn.models.scene.collision import collision_model
from armdyn.models.scene.obstacles import SHAPES
from armdyn.optimal.path_constraints.registry import path_constraints_of
from armdyn.show.visuals import obstacle_shapes

DOCS = (Path(__file__).parents[1] / "docs" / "extending.md").read_text()


def shown(section):
    """The names that the Python of a section defines."""
    text = re.search(rf"(?ms)^## {section}\n(.*?)(?=^## |\Z)", DOCS)[1]
    made = {"__name__": "extending"}
    for block in re.findall(r"```python\n(.*?)```", text, re.S):
        exec(block, made)
    return made


@pytest.fixture
def cylinder():
    """The class of the docs, for the time of a test."""
    yield shown("An obstacle shape")["Cylinder"]
    del SHAPES["cylinder"]


def test_an_obstacle_shape(cylinder, tmp_path):
    turned = np.eye(4)
    turned[:3, :3], turned[:3, 3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]], [0.1, 0.2, 0.3]
    one = cylinder(0.1, 0.4, turned)
    p, scene = ca.SX.sym("p", 3), ca.SX.sym("scene", one.count)
    body = one.symbolic(scene)
    distance = ca.Function("distance", [p, scene], [body.distance(p) - body.thickness])
    placement, solid = one.solid()
    at = coal.Transform3s(placement[:3, :3], placement[:3, 3])
    for point in np.random.default_rng(0).uniform(-1, 1, (100, 3)):
        ball = coal.Sphere(1e-6), coal.Transform3s(np.eye(3), point)
        exact = coal.distance(*ball, solid, at, coal.DistanceRequest(), coal.DistanceResult())
        # Rounded off by 1e-4 m at the axis and at the surface; GJK stops at 1e-6.
        assert exact < 0.01 or -2.1e-4 < float(distance(point, one.numbers())) - exact < 1e-5
    # It is kept clear of, drawn, written and read like the other shapes.
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("rr"))
    problem = ad.MinimumTimeProblem(robot, q_start=[-1.5, 0.0], q_goal=[0.2, 0.0], obstacles=[one])
    assert [constraint.name for constraint in path_constraints_of(problem)] == ["obstacles"]
    (tmp_path / "problem.toml").write_text(problem.to_toml())
    (again,) = ad.read_problem(tmp_path / "problem.toml").obstacles
    assert np.allclose(again.numbers(), one.numbers(), atol=1e-14)
    assert len(obstacle_shapes([one])) == 1
    (told,) = obstacles_of(["cylinder:0.1,0.4@0.3,0,0.2"])
    assert told == cylinder(0.1, 0.4, [0.3, 0.0, 0.2])
    assert collision_model(robot, (told,), False).nearest([0.0, 0.0]).distance < 0
    with pytest.raises(ProblemError, match="cylinder:R,L@X,Y,Z"):
        obstacles_of(["cylinder:0.1@0,0,0"])
    with pytest.raises(ProblemError, match="radius of obstacle 'cylinder' is 0"):
        cylinder(0, 1, [0, 0, 0])
