"""The arm's bodies, the capsules around them, and distances that are known in closed form."""

import coal
import numpy as np
import pinocchio as pin
import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.models.scene.bodies import bodies, capsules, volume
from armdyn.models.scene.collision import CollisionModel, collision_model
from armdyn.models.scene.obstacles import Box, Capsule, Sphere
from oracles import robot_named
from problems import CART, cart, paper_arm


def from_segment(capsule, points):
    a, b = np.array(capsule.a), np.array(capsule.b)
    t = np.clip((points - a) @ (b - a) / max((b - a) @ (b - a), 1e-300), 0, 1)
    return np.linalg.norm(points - a - t[:, None] * (b - a), axis=1)


def test_capsules_contain_the_panda_and_are_not_much_larger():
    own = bodies(robot_named("panda"))
    assert {body.name for body in own} >= {f"panda_link{i}" for i in range(8)} | {"panda_hand"}
    for body in own:
        if not isinstance(body.geometry, coal.Convex):
            continue  # the fingers are boxes
        points = np.array([body.geometry.point(i) for i in range(body.geometry.num_points)])
        points = points @ body.placement[:3, :3].T + body.placement[:3, 3]
        assert np.max(from_segment(body.capsule, points)) <= body.capsule.radius + 1e-12  # rounding
        body.geometry.computeLocalAABB()
        solid = abs(body.geometry.computeVolume())
        assert volume(body.capsule) < 4 * solid  # of a cube's own 3.6: none is a cube
    parts = {}
    for name, joint, capsule in capsules(robot_named("panda")):
        parts.setdefault((name, joint), []).append(capsule)
    for body in own:  # every body in one of its link's capsules: both ends, with so much less radius
        ends = np.array([body.capsule.a, body.capsule.b])
        assert any(
            np.max(from_segment(capsule, ends)) <= capsule.radius - body.capsule.radius + 1e-12
            for capsule in parts[body.name, body.joint]
        )


def test_distances_in_closed_form():
    # RR stretched out along x: a rod of radius 12 mm from 0 to 0.25 m, one to 0.484 m, a ball of 20.7 mm there.
    robot = paper_arm("rr")
    for obstacle in (
        Sphere((0.1, 0, 0.2), 0.05),
        Capsule((0.1, -1, 0.2), (0.1, 1, 0.2), 0.05),
        Box((0.1, 1, 0.1), (0.1, 0, 0.2)),
    ):
        near = CollisionModel(robot, [obstacle]).nearest([0.0, 0.0])
        # GJK on curved shapes stops at 1e-6 of their size.
        assert near.distance == pytest.approx(0.2 - 0.05 - 0.012, abs=1e-6)
        assert (near.body, near.other) == ("link1", obstacle.name)
    near = CollisionModel(robot, [Sphere((0.6, 0, 0), 0.1)]).nearest([0.0, 0.0])
    assert near.body == "payload"
    assert near.distance < 0.6 - 0.484 - 0.1
    assert "inside" in str(CollisionModel(robot, [Sphere((0.1, 0, 0), 0.05)]).nearest([0.0, 0.0]))


def test_links_that_are_built_touching_are_left_out():
    pairs = CollisionModel(robot_named("panda"), self_collision=True).pairs
    assert ("panda_link3", "panda_link4") not in pairs
    assert ("panda_link0", "panda_hand") in pairs
    folded = [0, 1.7, 0, -3.0, 0, 0.5, 0]
    assert collision_model(robot_named("panda"), (), True).nearest(folded).distance < 0


def test_along_a_motion_misses_nothing_thin():
    # The stretched arm turns a quarter at constant speed, past a needle at 45 degrees that only touches the tip.
    robot = ad.Robot.from_spec(ad.ArmSpec.paper("r"))
    t = np.linspace(0, 1, 3)
    motion = ad.Trajectory(t, (np.pi / 2 * t)[:, None], np.full((3, 1), np.pi / 2), np.zeros((3, 1)))
    at = 0.245 * np.sqrt(0.5)
    model = CollisionModel(robot, [Sphere((at, 0, at), 1e-4)])
    near, least = model.along(motion)
    assert near.distance < 0 and not near.sure
    assert near.time == pytest.approx(0.5, abs=0.05)  # the rod is 24 mm thick: 0.05 rad on either side
    assert np.min(least) == near.distance
    clear, _ = CollisionModel(robot, [Sphere((0.4, 0, 0.4), 0.05)]).along(motion)
    assert clear.sure and clear.distance > 0.2


def test_what_cannot_be_checked_is_an_error(read):
    with pytest.raises(ProblemError, match="no geometry"):
        bodies(cart())
    mesh = '<collision><geometry><mesh filename="gone.stl"/></geometry></collision></link>'
    with pytest.raises(ProblemError, match=r"gone\.stl"):
        bodies(read(CART.replace("</link>", mesh)))


def test_an_arm_reaches_as_far_as_it_says():
    robot = robot_named("ur5")
    model = collision_model(robot, (), True)
    random, data = np.random.default_rng(0), robot.model.createData()
    for _ in range(20):
        q, v = random.uniform(-3, 3, (2, robot.nv))
        pin.forwardKinematics(robot.model, data, robot.configuration(q), v)
        for name, joint, capsule in capsules(robot):
            speed = data.v[joint]
            for end in (capsule.a, capsule.b):
                moves = np.linalg.norm(speed.linear + np.cross(speed.angular, end))
                assert moves <= np.abs(v) @ model._reach + 1e-12, name
