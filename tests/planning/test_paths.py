"""Planned paths: free where looked at, the same for the same seed, none where there is none."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.models.scene.collision import CollisionModel
from armdyn.models.scene.obstacles import Box, Cylinder, Sphere
from armdyn.planning.paths import JointSpace, PlannerOptions, length, plan_paths
from problems import GANTRY, paper_arm

WIDE = 10.0
DISK, POINT = 0.99, 0.01
"""Radii of a disk and of the ball that moves round it: together 1 m."""
BALL = f'<collision><geometry><sphere radius="{POINT}"/></geometry></collision>'
MOVING_POINT = GANTRY.replace('<link name="head">', f'<link name="head">{BALL}')
"""Two slides: joint positions are a point's place in the plane."""


EVERYWHERE = PlannerOptions(everywhere=1)
"""All attempts' random points are in the whole plane: ways round these obstacles lead far away from the ends."""


class Counting(CollisionModel):
    checks = 0

    def plan(self, *given):
        path, used = super().plan(*given)
        self.checks += used
        return path, used


def space(*obstacles):
    model = Counting(ad.Robot.from_urdf_string(MOVING_POINT), obstacles)
    return JointSpace(model, np.full(2, -WIDE), np.full(2, WIDE), np.ones(2), np.empty(0))


def disk():
    return space(Cylinder((0, 0, -1), (0, 0, 1), DISK))


def dense(path, samples=400):
    marks = np.linspace(0, len(path) - 1, samples)
    return np.array([np.interp(marks, np.arange(len(path)), path[:, j]) for j in range(path.shape[1])]).T


def test_the_straight_line_where_it_is_free():
    (path,) = plan_paths(space(), np.zeros(2), np.ones(2))
    np.testing.assert_array_equal(path, [[0, 0], [1, 1]])


def test_round_a_disk_a_path_is_nearly_as_short_as_can_be():
    start, goal = np.array([-2.0, 0.0]), np.array([2.0, 0.0])
    paths = list(plan_paths(disk(), start, goal, 3, EVERYWHERE))
    for path in paths:
        np.testing.assert_array_equal(path[[0, -1]], [start, goal])
        assert np.min(np.linalg.norm(dense(path), axis=1)) > 1 - 0.02**2 / 2 - 1e-3  # checked 0.02 apart
    times = [length(path) for path in paths]
    # In the largest component: up to the corner of the square around the disk's quarter and down again, 4 at least.
    assert 4 <= min(times) < 4.4


def test_the_same_seed_gives_the_same_paths_in_any_order():
    def paths(seed):
        return list(plan_paths(disk(), np.array([-2.0, 0]), np.array([2.0, 0]), seed))

    first, other, again = paths(0), paths(1), paths(0)
    assert len(first) == len(again)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[0], other[0])


def test_none_is_found_through_a_wall_and_the_budget_ends_it():
    walled = space(Box((1.0, 30.0, 1.0), (0, 0, 0)))
    options = PlannerOptions(checks=5_000)
    assert not list(plan_paths(walled, np.array([-2.0, 0]), np.array([2.0, 0]), options=options))
    assert walled.model.checks == 5_000


def test_a_way_outside_the_box_around_both_ends_is_found():
    # Its ends are 5.5 m from the straight line, ten times `PlannerOptions.beyond` at 1 m/s.
    wall = space(Box((1.0, 11.0, 1.0), (0, 0, 0)))
    path = next(plan_paths(wall, np.array([-2.0, 0]), np.array([2.0, 0])))
    assert np.max(np.abs(path[:, 1])) > 5.5


def test_a_stop_ends_an_attempt():
    walled, requests = space(Box((1.0, 30.0, 1.0), (0, 0, 0))), []

    def stop():
        requests.append(walled.model.checks)
        return len(requests) > 5

    assert not list(plan_paths(walled, np.array([-2.0, 0]), np.array([2.0, 0]), stop=stop))
    assert walled.model.checks < PlannerOptions().checks


def test_a_path_is_planned_on_demand():
    wall = space(Box((0.4, 5.0, 1.0), (0, 0, 0)))  # so that a path round it is not nearly straight
    paths = plan_paths(wall, np.array([-2.0, 0]), np.array([2.0, 0]), 3, EVERYWHERE)
    next(paths)
    first = wall.model.checks
    assert len(list(paths)) > 0 and wall.model.checks > 2 * first


@pytest.mark.parametrize("slower", [1.0, 1e-7])
def test_plan_path_of_a_problem(slower):
    """At very low velocity limits checks are no nearer to each other, and the budget does not end first."""
    wall = Box((0.3, 0.3, 0.02), (0.3, 0, -0.15), name="wall")
    problem = ad.MinimumTimeProblem(paper_arm("rr"), q_start=[1.5, 0], q_goal=[0.0, 0.3], obstacles=[wall])
    problem = problem.variant(velocity_limit=slower * problem.limits.velocity)
    path = ad.plan_path(problem, seed=1)
    np.testing.assert_array_equal(path, ad.plan_path(problem, seed=1))
    np.testing.assert_allclose(path[[0, -1]], [problem.q_start, problem.q_goal])
    assert all(problem.collision_model().is_free(q) for q in dense(path))


@pytest.mark.slow
def test_where_there_is_no_path_it_says_so():
    # A floor and a ceiling of balls between which the first link cannot leave.
    ends = [(0.2 * np.cos(a), 0, -0.2 * np.sin(a)) for a in (0.5, -0.5)]
    shell = [Sphere(end, 0.03, name=f"bar {k}") for k, end in enumerate(ends)]
    problem = ad.MinimumTimeProblem(paper_arm("rr"), q_start=[0, 0], q_goal=[1.2, 0], obstacles=shell, clearance=0.001)
    problem = problem.variant(position_limit=([-3, -3], [3, 3]))
    with pytest.raises(ProblemError, match="no collision-free path was found in 200000 collision checks"):
        ad.plan_path(problem)
