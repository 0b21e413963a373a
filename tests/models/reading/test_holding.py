"""Poses that take the most torque to be held, against a closed form and a search over a grid."""

import itertools

import numpy as np
import pytest

from armdyn.models.reading.holding import hardest_poses
from oracles import robot_named


def test_a_planar_arm_is_hardest_to_hold_stretched_out():
    """The first joint carries all weights at their largest distances; a part of 0.98 of it suffices."""
    robot = robot_named("rrr")
    lengths, weights = [], []
    for inertia, place in zip(list(robot.model.inertias)[1:], list(robot.model.jointPlacements)[1:], strict=True):
        lengths.append(np.linalg.norm(place.translation) + (lengths[-1] if lengths else 0.0))
        weights.append(9.81 * inertia.mass * (lengths[-1] + np.linalg.norm(inertia.lever)))
    (pose, torque), *_ = hardest_poses(robot.model, robot.limits.position_lower, robot.limits.position_upper)
    assert 0.98 * sum(weights) <= abs(torque) <= sum(weights) * (1 + 1e-9)
    assert robot.holding_torque(pose)[0] == pytest.approx(torque)


@pytest.mark.parametrize("name", ["ur5", "z1"])
def test_no_pose_of_a_grid_takes_much_more(name):
    robot = robot_named(name)
    lower, upper = (np.clip(end, -np.pi, np.pi) for end in (robot.limits.position_lower, robot.limits.position_upper))
    found = hardest_poses(robot.model, lower, upper)
    turning = [np.linspace(lower[i], upper[i], 9) for i in (1, 2, 3)]
    for grid in itertools.product(*turning):
        q = np.zeros(robot.nv)
        q[1:4] = grid
        held = np.abs(robot.holding_torque(np.clip(q, lower, upper)))
        assert np.all(0.98 * held <= np.abs([torque for _, torque in found]) + 1e-9)
    for j, (q, torque) in enumerate(found):
        assert np.all((lower <= q) & (q <= upper)) and robot.holding_torque(q)[j] == pytest.approx(torque)
