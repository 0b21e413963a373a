"""Ends of legs against sampled joint positions."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.dynamics.symbolic import Dynamics
from armdyn.models.scene.reaching import free_directions, poses_reaching, slid
from armdyn.optimal.bound.goal_set import GoalSet, Within
from armdyn.optimal.bound.interval import Interval
from armdyn.optimal.bound.leg import LegEnd
from armdyn.optimal.problem.policy.bound import BoundPolicy


@pytest.mark.slow
def test_the_least_of_a_redundant_end_is_below_all_its_positions_and_near_the_least_of_them():
    """Ends of a Panda, one of whose self-motions is 0.1 rad long: second-order terms are some milliradians."""
    robot = ad.Robot.from_library("panda")
    goal = ad.GoalPose(robot.tip, np.array([[1, 0, 0, 0.5], [0, -1, 0, 0.15], [0, 0, -1, 0.3], [0, 0, 0, 1.0]]))
    limits = robot.limits
    middle = (limits.position_lower + limits.position_upper) / 2
    near = poses_reaching(robot, goal, middle, limits)[0]
    along = free_directions(robot, goal, near)[:, 0]
    found = [slid(robot, goal, near, step * along, limits) for step in np.linspace(-0.05, 0.05, 41)]
    positions = np.array([q for q in found if q is not None])
    assert len(positions) > 30
    box = Interval(positions.min(axis=0) - 1e-4, positions.max(axis=0) + 1e-4)
    within = Within((), limits.velocity, Interval(limits.position_lower, limits.position_upper), 10.0)
    goals = GoalSet(Dynamics(robot), goal, within, BoundPolicy())
    end, rng = LegEnd(box, np.zeros(7), goals.closure_over(box)), np.random.default_rng(7)
    for weights in rng.uniform(-1, 1, (30, 7)):
        across = weights - (weights @ along) * along
        for row in (weights, across):
            assert end.least(row) <= np.min(positions @ row)
        least = np.sum(across * box.centre) - np.abs(across) @ box.radius  # of the box alone
        assert np.min(positions @ across) - end.least(across) < 0.02
        assert end.least(across) >= least - 1e-12
