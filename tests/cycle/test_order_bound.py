"""The bound of a free order against all orders and all branches, one by one."""

from itertools import pairwise, permutations, product

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.cycle.graph import CycleGraph
from armdyn.cycle.order_bound import order_bound
from armdyn.models.scene.reaching import poses_reaching
from armdyn.optimal.bound.lattice import Effort
from problems import paper_arm

START = np.array([0.1, 0.4])
HOLES = ([0.9, 0.5], [1.5, -0.7], [-0.6, 0.9])


@pytest.fixture(scope="module")
def holes():
    """A two-link arm that slows down at its velocity limits, and three positions with two branches each."""
    robot, goals = paper_arm("rr").with_limits(None, 2.0), []
    for q in HOLES:
        data = robot.model.createData()
        pin.framesForwardKinematics(robot.model, data, np.array(q))
        goals.append(ad.GoalPose(robot.tip, data.oMf[robot.model.getFrameId(robot.tip)].translation))
    steps = [step for k, goal in enumerate(goals) for step in (ad.Move(goal, name=f"hole {k}"), ad.Wait(0.05))]
    return ad.Cycle(robot, start=START, steps=steps, closed=True, order="free"), goals


@pytest.fixture(scope="module")
def least(holes):
    """The least sum of bounds over all orders, branches and ways round."""
    cycle, goals = holes
    stops = [[START], *(poses_reaching(cycle.robot, goal, START, cycle.robot.limits, seed=7) for goal in goals)]
    assert [len(own) for own in stops] == [1, 2, 2, 2]
    known = {}
    for (i, here), (j, there) in permutations([(k, q) for k, own in enumerate(stops) for q in own], 2):
        problem = ad.MinimumTimeProblem(cycle.robot, q_start=here, q_goal=there, wrap=True)
        known[i, here.tobytes(), j, there.tobytes()] = ad.lower_bound(problem).duration
    found = []
    for order in permutations(range(1, 4)):
        for way in product(*(stops[k] for k in order)):
            tour = [(0, START), *zip(order, way, strict=True), (0, START)]
            found.append(sum(known[i, a.tobytes(), j, b.tobytes()] for (i, a), (j, b) in pairwise(tour)))
    assert max(found) > 1.1 * min(found)
    return min(found)


@pytest.mark.slow
def test_no_order_and_no_branches_are_below_the_bound(holes, least):
    """It chooses branches move by move, which costs some tightness."""
    cycle, _ = holes
    found = order_bound(CycleGraph.of(cycle), 10.0, Effort(1000))
    assert 0.85 * least < found <= least * (1 + 1e-9)


@pytest.mark.slow
def test_a_bound_that_is_stopped_or_enough_is_lower(holes, least):
    graph = CycleGraph.of(holes[0])
    stopped = order_bound(graph, 10.0, Effort(1000, lambda: True))
    assert 0 <= stopped <= least  # nothing yet, if no box was looked into
    assert order_bound(graph, 0.5 * least, Effort(1000)) == 0.5 * least


@pytest.mark.slow
def test_a_free_order_of_goal_poses_has_a_gap(holes, least):
    solved = ad.solve_cycle(holes[0], ad.MinimumTimeOptions(search="quick", workers=1))
    assert solved.usable
    assert 0.85 * least < solved.lower_bound - holes[0].dwell <= least * (1 + 1e-9)
    assert 0 < solved.gap < 0.2
