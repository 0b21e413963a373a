"""Planned paths: free where looked at, the same for the same seed, none where there is none."""

import numpy as np
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.models.scene.obstacles import Box, Sphere
from armdyn.planning.paths import JointSpace, plan_paths
from armdyn.planning.rrt_connect import PlannerOptions
from problems import paper_arm

WIDE = 10.0


def space(is_free, n=2):
    def free_until(points):
        return next((k for k, point in enumerate(points) if not is_free(point)), len(points))

    return JointSpace(free_until, np.full(n, -WIDE), np.full(n, WIDE), np.ones(n))


def dense(path, samples=400):
    marks = np.linspace(0, len(path) - 1, samples)
    return np.array([np.interp(marks, np.arange(len(path)), path[:, j]) for j in range(path.shape[1])]).T


def test_the_straight_line_where_it_is_free():
    (path,) = plan_paths(space(lambda q: True), np.zeros(2), np.ones(2))
    np.testing.assert_array_equal(path, [[0, 0], [1, 1]])


def test_round_a_disk_a_path_is_nearly_as_short_as_can_be():
    start, goal = np.array([-2.0, 0.0]), np.array([2.0, 0.0])
    paths = list(plan_paths(space(lambda q: bool(np.linalg.norm(q) > 1)), start, goal, seed=3))
    for path in paths:
        np.testing.assert_array_equal(path[[0, -1]], [start, goal])
        assert np.min(np.linalg.norm(dense(path), axis=1)) > 1 - 0.02**2 / 2 - 1e-3  # checked 0.02 apart
    times = [np.sum(np.max(np.abs(np.diff(path, axis=0)), axis=1)) for path in paths]
    # In the largest component: up to the corner of the square around the disk's quarter and down again, 4 at least.
    assert 4 <= min(times) < 4.4


def test_the_same_seed_gives_the_same_paths_in_any_order():
    def paths(seed):
        free = space(lambda q: bool(np.linalg.norm(q) > 1))
        return list(plan_paths(free, np.array([-2.0, 0]), np.array([2.0, 0]), seed))

    first, other, again = paths(0), paths(1), paths(0)
    assert len(first) == len(again)
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[0], other[0])


def test_none_is_found_through_a_wall_and_the_budget_ends_it():
    count = [0]

    def is_free(q):
        count[0] += 1
        return abs(q[0]) > 0.5

    options = PlannerOptions(checks=5_000)
    assert not list(plan_paths(space(is_free), np.array([-2.0, 0]), np.array([2.0, 0]), options=options))
    assert count[0] <= 5_000


def test_a_path_that_nobody_asks_for_is_not_planned():
    count = [0]

    def is_free(q):  # but for a wall, so that a path round it is not nearly straight
        count[0] += 1
        return bool(abs(q[0]) > 0.2 or abs(q[1]) > 2.5)

    paths = plan_paths(space(is_free), np.array([-2.0, 0]), np.array([2.0, 0]), seed=3)
    next(paths)
    first = count[0]
    assert len(list(paths)) > 0 and count[0] > 2 * first


def test_plan_path_of_a_problem():
    wall = Box((0.3, 0.3, 0.02), (0.3, 0, -0.15), name="wall")
    problem = ad.MinimumTimeProblem(paper_arm("rr"), q_start=[1.5, 0], q_goal=[0.0, 0.3], obstacles=[wall])
    path = ad.plan_path(problem, seed=1)
    np.testing.assert_array_equal(path, ad.plan_path(problem, seed=1))
    np.testing.assert_allclose(path[[0, -1]], [problem.q_start, problem.q_goal])
    assert all(problem.collision_model().is_free(q) for q in dense(path))


def test_where_there_is_no_path_it_says_so():
    # A floor and a ceiling of balls between which the first link cannot leave.
    ends = [(0.2 * np.cos(a), 0, -0.2 * np.sin(a)) for a in (0.5, -0.5)]
    shell = [Sphere(end, 0.03, name=f"bar {k}") for k, end in enumerate(ends)]
    problem = ad.MinimumTimeProblem(paper_arm("rr"), q_start=[0, 0], q_goal=[1.2, 0], obstacles=shell, clearance=0.001)
    problem = problem.variant(position_limit=([-3, -3], [3, 3]))
    with pytest.raises(ProblemError, match="no collision-free path was found in 200000 collision checks"):
        ad.plan_path(problem)
