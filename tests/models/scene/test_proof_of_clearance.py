"""Proofs of clearance: against a dense look, and walls thinner than a step."""

import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.models.scene.bodies import bodies
from armdyn.models.scene.collision import CollisionModel
from armdyn.models.scene.obstacles import Box, Plane, Sphere
from armdyn.models.scene.proof_of_clearance import motion_bounds, prove_clearance, relative_reach
from oracles import robot_named
from problems import paper_arm


def swing(robot, start, goal, samples=30):
    """A motion from rest to rest along a cubic in time, one second long."""
    t = np.linspace(0, 1, samples)
    part, rate = t**2 * (3 - 2 * t), 6 * t * (1 - t)
    q = start + np.outer(part, np.subtract(goal, start))
    v = np.outer(rate, np.subtract(goal, start))
    return ad.Trajectory(t, q, v, np.zeros_like(q), robot.joint_names)


def test_a_needle_that_only_the_tip_touches_is_found():
    # The stretched arm turns a quarter at constant speed, past a needle at 45 degrees.
    robot = paper_arm("r")
    t = np.linspace(0, 1, 3)
    motion = ad.Trajectory(t, (np.pi / 2 * t)[:, None], np.full((3, 1), np.pi / 2), np.zeros((3, 1)))
    at = 0.245 * np.sqrt(0.5)
    nearest, missed = prove_clearance(CollisionModel(robot, [Sphere((at, 0, at), 1e-4)]), motion, 0.0)
    assert nearest.distance < 0 and not nearest.sure and missed
    assert all(abs(time - 0.5) < 0.06 for time in missed)  # the rod is 24 mm thick: 0.05 rad on either side
    nearest, missed = prove_clearance(CollisionModel(robot, [Sphere((0.4, 0, 0.4), 0.05)]), motion, 0.1)
    assert nearest.sure and not missed and nearest.distance > 0.2


@pytest.mark.slow
@pytest.mark.parametrize("thick", [5e-4, 1e-3])
def test_a_thin_wall_that_is_crossed_is_never_proven_clear(thick):
    robot, random = robot_named("panda"), np.random.default_rng(5)
    low, high = robot.limits.position_lower, robot.limits.position_upper
    crossed = 0
    for _ in range(50):
        start, goal = random.uniform(low, high), random.uniform(low, high)
        motion = swing(robot, start, goal)
        wall = Box((thick, 0.6, 0.6), (random.uniform(0.2, 0.6), 0, random.uniform(0.3, 0.8)))
        model = CollisionModel(robot, [wall])
        looks = motion(np.linspace(0, 1, 4001)).q
        # A body that has come to the other side of the wall has crossed it, or gone round: only contact is counted.
        touching = any(not model.is_free(q) for q in looks)
        nearest, _ = prove_clearance(model, motion, 1e-4)
        crossed += touching
        if touching:
            assert not nearest.sure
        if nearest.sure:
            assert min(np.min(model.distances(q, 0.01)) for q in looks[::8]) >= 1e-4
    assert crossed > 10


@pytest.mark.slow
def test_points_of_the_arm_stay_within_the_bounds_on_their_motion():
    robot = robot_named("panda")
    random, data = np.random.default_rng(0), robot.model.createData()
    start, goal = random.uniform(robot.limits.position_lower, robot.limits.position_upper, (2, 7))
    motion = swing(robot, start, goal)
    _, acceleration = motion_bounds(robot, motion)
    for k, t in enumerate((motion.t[:-1] + motion.t[1:]) / 2):
        at = motion(t)
        h = 1e-6
        before, after = motion(t - h), motion(t + h)
        a = (after.v - before.v) / (2 * h)
        pin.forwardKinematics(robot.model, data, robot.configuration(at.q), at.v, a)
        for body in bodies(robot):
            if not body.joint:
                continue
            own = pin.getClassicalAcceleration(robot.model, data, body.joint, pin.LOCAL)
            spatial, turn = data.a[body.joint], data.v[body.joint].angular
            points = np.asarray(body.points)
            moved = own.linear + np.cross(spatial.angular, points) + np.cross(turn, np.cross(turn, points))
            assert np.all(np.linalg.norm(moved, axis=1) <= acceleration[k, body.joint] * (1 + 1e-6))


def test_the_relative_reach_bounds_how_distances_change():
    robot = robot_named("ur5")
    model = CollisionModel(robot, [Sphere((0.5, 0.2, 0.4), 0.1)], True)
    reach, random = relative_reach(model), np.random.default_rng(0)
    for _ in range(20):
        q, step = random.uniform(-3, 3, 6), random.uniform(-0.05, 0.05, 6)
        change = np.abs(model.distances(q + step) - model.distances(q))
        assert np.all(change <= reach @ np.abs(step) + 1e-5)  # GJK's tolerance on curved shapes


@pytest.mark.parametrize("turned", [0.0, 0.7])
def test_a_half_space_is_proven_clear_just_where_it_is(turned):
    robot, random = robot_named("panda"), np.random.default_rng(2)
    low, high = robot.limits.position_lower, robot.limits.position_upper
    normal, verdicts = np.array([np.sin(turned), 0, np.cos(turned)]), []
    for _ in range(12):
        motion = swing(robot, random.uniform(low, high), random.uniform(low, high))
        model = CollisionModel(robot, [Plane(-0.1 * normal, normal)])
        least = min(np.min(model.distances(q)) for q in motion(np.linspace(0, 1, 1001)).q)
        nearest, _ = prove_clearance(model, motion, 1e-3)
        assert nearest.sure == (least >= 1e-3)  # no look is within 0.1 mm of the clearance
        assert model.is_free(motion.q[-1]) == (np.min(model.distances(motion.q[-1])) > 0)
        verdicts.append(nearest.sure)
    assert 0 < sum(verdicts) < 12
