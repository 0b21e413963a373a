"""Distances of a curve as rows: slopes against differences, poses where bodies pass each other."""

from dataclasses import replace

import numpy as np
import pytest

import armdyn as ad
from armdyn.models.scene.obstacles import Box
from armdyn.optimal.constraints.clearance import ClearanceConstraint
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curve import Basis, Curve, graded
from armdyn.optimal.curves.layout import curve_layout
from armdyn.optimal.curves.linear_rows import clearance_rows
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.task import Task
from oracles import robot_named


@pytest.fixture(scope="module")
def swing():
    """A Panda's swing over a post: problem, curve, policy."""
    post = Box((0.1, 0.1, 0.3), (0.7, 0, 0.15), name="post")  # 3 to 20 mm from hand and fingers
    assemble_curve = [0, 0.3, 0, -1.9, 0, 2.2, 0.785]
    problem = ad.MinimumTimeProblem(
        robot_named("panda"),
        q_start=[-0.8, *assemble_curve[1:]],
        q_goal=[0.8, *assemble_curve[1:]],
        obstacles=[post],
        clearance=1e-3,
    )
    return problem, Curve.straight(problem, Basis(graded(40, 3e-3, 0.05)), 1.0), Policy.of(problem)


def test_slopes_by_the_control_points_against_differences(swing):
    problem, curve, policy = swing
    required = ClearanceConstraint().required_distances(problem)
    rows = clearance_rows(required, curve, policy)
    shape = curve_layout(problem, curve, TightenedConstraints.of(Task.of(problem)))
    x = np.zeros(shape.size)
    x[shape.points(0)] = curve.legs[0].points
    change = np.random.default_rng(0).normal(size=shape.points(0).shape)
    moved = x.copy()
    moved[shape.points(0)] += 1e-3 * change
    every = replace(rows, within=np.inf, most=len(required.model.pairs))
    before, after = every.at(shape, x), every.at(shape, moved)
    poses = (before.missing.size, len(required.model.pairs))
    expected = np.sort((before.spare + before.jacobian @ (moved - x)).reshape(poses), axis=1)
    found, unmoved = (np.sort(one.spare.reshape(poses), axis=1) for one in (after, before))
    # Some millimetres of motion, to second order and GJK's 1e-6 m; nearest points that change add a few hundredths.
    assert np.max(np.abs(found - unmoved)) > 1e-3
    np.testing.assert_allclose(found, expected, atol=1e-4)


def test_poses_are_where_bodies_pass_each_other(swing):
    problem, curve, policy = swing
    required = ClearanceConstraint().required_distances(problem)
    ((_, places),) = clearance_rows(required, curve, policy).legs
    looks = np.linspace(0, 1, 2001)
    distances = required.model.distances(curve.legs[0].at(looks)[0])
    step = 1 / (policy.curves.intervals + 1)
    for pair in np.flatnonzero(np.min(distances, axis=0) < policy.sequential.passing):
        nearest = looks[np.argmin(distances[:, pair])]
        if step < nearest < 1 - step and np.min(distances[:, pair]) > 0:
            assert np.min(np.abs(places - nearest)) < step / 8
    assert np.all((places > 0) & (places < 1)) and np.all(np.diff(places) > 0) and places.size > policy.curves.intervals


def test_a_pair_just_beyond_the_clearance_at_the_goal_must_keep_more_than_the_clearance(swing):
    problem = swing[0]
    near = float(np.min(problem.collision_model().distances(np.asarray(problem.poses))))
    tight = problem.variant(clearance=near - 3e-4)  # as a finger next to the part to grasp
    required = ClearanceConstraint().required_distances(tight)
    assert tight.clearance < np.min(required.most) < near
