"""Rows of a goal region against Pinocchio's own placements."""

from types import SimpleNamespace

import casadi as ca
import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.models.scene.reaching import swing
from armdyn.optimal.constraints.goal_region import GoalRegion

TOLERANCE = (0.1, 0.2, 0.0, 0.0, 0.3, 0.4)


@pytest.mark.parametrize(
    ("region", "rows"), [({"tolerance": TOLERANCE}, 6), ({"free": ("ry",)}, 5), ({"free": ("x", "rx", "ry", "rz")}, 2)]
)
def test_deviations_are_those_of_the_placements(region, rows):
    robot, rng = ad.Robot.from_library("ur5"), np.random.default_rng(0)
    centre = pin.SE3.Random()
    goal = ad.GoalPose("tool0", centre, **region)
    problem = ad.MinimumTimeProblem(robot, q_start=np.zeros(6), q_goal=np.full(6, 0.1))
    (one,), (values,) = GoalRegion(goal).rows(problem), GoalRegion(goal).values(problem)
    assert np.shape(values.upper) == (rows,) and np.all(np.isfinite(values.upper)) and one.where == "last"
    scale = 1 / values.numbers[12:]
    np.testing.assert_allclose(values.upper * scale, goal.deviations[np.isfinite(goal.deviations)])
    q = ca.SX.sym("q", 6)
    stages = SimpleNamespace(q=ca.horzcat(0 * q, q), dynamics=ad.Dynamics(robot))
    function = ca.Function("rows", [q], [one.expression(stages, ca.SX(values.numbers), *one.arguments)])
    model, data, frame = robot.model, robot.model.createData(), robot.model.getFrameId("tool0")
    for at in rng.uniform(-2, 2, (20, 6)):
        pin.framesForwardKinematics(model, data, at)
        off = centre.actInv(data.oMf[frame])
        turn = pin.log3(off.rotation) if goal.axis is None else swing(np.eye(3)[1], off.rotation[:, 1])
        expected = np.append(off.translation, turn)[np.isfinite(goal.deviations)]
        np.testing.assert_allclose(function(at).full().ravel() * scale, expected, atol=1e-9)
