"""The arm's bodies, the balls around them, and distances that are known in closed form."""

import coal
import numpy as np
import pinocchio as pin
import pytest

from armdyn.errors import BridgeError, ProblemError
from armdyn.models.scene.bodies import bodies
from armdyn.models.scene.collision import CollisionModel, collision_model
from armdyn.models.scene.geometry import scene_geometry
from armdyn.models.scene.obstacles import Box, Capsule, Cylinder, Plane, Sphere
from oracles import robot_named
from problems import CART, cart, paper_arm


def test_balls_contain_the_panda_and_are_not_much_larger():
    own = bodies(robot_named("panda"))
    assert {body.name for body in own} >= {f"panda_link{i}" for i in range(8)} | {"panda_hand"}
    random = np.random.default_rng(0)
    for body in own:
        centers, ball = body.balls
        weights = random.dirichlet(np.full(len(body.points), 0.2), 2000)
        inside = np.vstack([body.points, weights @ body.points])  # of the hull, edges and faces mostly
        away = np.min(np.linalg.norm(inside[:, None] - centers, axis=2), axis=1)
        assert np.max(away) + body.radius <= ball + 1e-12  # rounding
        if isinstance(body.geometry, coal.Convex):  # the fingers are boxes
            body.geometry.computeLocalAABB()
            solid, length = abs(body.geometry.computeVolume()), np.linalg.norm(centers[-1] - centers[0])
            assert np.pi * ball**2 * (length + 4 / 3 * ball) < 6 * solid  # measured: 2.9 to 4.9


def test_distances_in_closed_form():
    # RR stretched out along x: a rod of radius 12 mm from 0 to 0.25 m, one to 0.484 m, a ball of 20.7 mm there.
    robot = paper_arm("rr")
    for obstacle in (
        Sphere((0.1, 0, 0.2), 0.05),
        Capsule((0.1, -1, 0.2), (0.1, 1, 0.2), 0.05),
        Box((0.1, 1, 0.1), (0.1, 0, 0.2)),
        Cylinder((0.1, -1, 0.2), (0.1, 1, 0.2), 0.05),
        Cylinder((0.1, 0, 0.15), (0.1, 0, 0.3), 0.05),
    ):
        near = CollisionModel(robot, [obstacle]).nearer([0.0, 0.0], np.inf)[0]
        # GJK on curved shapes stops at 1e-6 of their size.
        assert near.distance == pytest.approx(0.2 - 0.05 - 0.012, abs=1e-6)
        assert (near.body, near.other) == ("link1", obstacle.name)
    # A half space below a plane at 0.2 m, turned upside down: of all solids the ball at the end is nearest.
    ceiling = CollisionModel(robot, [Plane((5, 3, 0.2), (0, 0, -2))])
    ball = ceiling.nearer([0.0, 0.0], np.inf)[0]
    assert ball.body == "payload" and ball.other == "plane"
    assert CollisionModel(robot, [Sphere((0.484, 0, 0.25), 0.05)]).nearer([0.0, 0.0], np.inf)[
        0
    ].distance == pytest.approx(ball.distance, abs=1e-6)
    near = CollisionModel(robot, [Sphere((0.6, 0, 0), 0.1)]).nearer([0.0, 0.0], np.inf)[0]
    assert near.body == "payload"
    assert near.distance < 0.6 - 0.484 - 0.1
    assert "inside" in str(CollisionModel(robot, [Sphere((0.1, 0, 0), 0.05)]).nearer([0.0, 0.0], np.inf)[0])


def test_the_nearest_pair_comes_first_though_links_have_several_solids():
    model = collision_model(robot_named("panda"), (Sphere((0.4, 0, 0.4), 0.05),), True)
    assert len(set(model.pairs)) < len(model.pairs)
    near = model.nearer(np.zeros(7), np.inf)
    assert len(near) == len(set(model.pairs))
    assert [one.distance for one in near] == sorted(one.distance for one in near)
    assert near[0].distance == pytest.approx(np.min(model.distances(np.zeros(7))), abs=1e-6)  # GJK's tolerance


def test_links_that_are_built_touching_are_left_out():
    pairs = CollisionModel(robot_named("panda"), self_collision=True).pairs
    assert ("panda_link3", "panda_link4") not in pairs
    assert ("panda_link0", "panda_hand") in pairs
    folded = [0, 1.7, 0, -3.0, 0, 0.5, 0]
    assert collision_model(robot_named("panda"), (), True).nearer(folded, np.inf)[0].distance < 0


def test_a_motion_that_cannot_be_checked_is_an_error(read):
    with pytest.raises(ProblemError, match="no geometry"):
        bodies(cart())
    mesh = '<collision><geometry><mesh filename="gone.stl"/></geometry></collision></link>'
    with pytest.raises(ProblemError, match=r"gone\.stl"):
        bodies(read(CART.replace("</link>", mesh)))


def test_gradients_of_distances_by_differences():
    robot = robot_named("panda")
    model = CollisionModel(robot, [Sphere((0.4, 0.2, 0.5), 0.05), Box((0.1, 0.2, 0.3), (0.5, -0.2, 0.4))], True)
    random, h = np.random.default_rng(1), 1e-4
    low, high = robot.limits.position_lower, robot.limits.position_upper
    poses = random.uniform(low, high, (20, robot.nv))
    near = model.near(poses, 0.3, 8)
    apart = np.flatnonzero(near.distances > 1e-3)  # where bodies overlap the distance has corners
    assert apart.size > 50
    for k in apart:
        q, pair = poses[near.poses[k]], near.pairs[[k]]
        np.testing.assert_allclose(near.distances[k], model.distances_of(pair, q)[0], atol=2e-6)
        slopes = [
            (model.distances_of(pair, q + step)[0] - model.distances_of(pair, q - step)[0]) / (2 * h)
            for step in h * np.eye(robot.nv)
        ]
        # GJK stops at 1e-6 m of the distance, twice in 2e-4 rad.
        np.testing.assert_allclose(near.gradients[k], slopes, atol=1e-2)


def test_far_pairs_have_lower_bounds():
    model = CollisionModel(robot_named("panda"), [Box((0.1, 0.2, 0.3), (0.5, -0.2, 0.4))], True)
    random = np.random.default_rng(2)
    for q in random.uniform(-1, 1, (20, 7)):
        exact, bounds = model.distances(q), model.distances(q, within=0.05)
        far = bounds > 0.05
        assert np.any(far) and np.all(bounds[far] <= exact[far] + 2e-6)
        np.testing.assert_allclose(bounds[~far], exact[~far], atol=2e-6)  # GJK's own tolerance


def test_pairs_that_may_touch_are_not_compared():
    robot = robot_named("panda")
    ball = Sphere((0.4, 0.2, 0.5), 0.05, name="can")
    pairs = CollisionModel(robot, [ball]).pairs
    fewer = CollisionModel(robot, [ball], allowed=[("can", "panda_hand")]).pairs
    assert set(pairs) - set(fewer) == {("panda_hand", "can")}


def test_distances_are_those_of_coal_through_pinocchio():
    robot = robot_named("panda")
    obstacles = [
        Sphere((0.4, 0.2, 0.5), 0.05),
        Box((0.1, 0.2, 0.3), (0.5, -0.2, 0.4)),
        Cylinder((0.3, -0.4, 0.2), (0.5, -0.4, 0.6), 0.07),
        Capsule((-0.4, 0.1, 0.1), (-0.4, 0.3, 0.9), 0.04),
        Plane((0, 0, -0.2), (0.1, 0, 1)),
    ]
    model = CollisionModel(robot, obstacles, True)
    solids, geometry = pin.GeometryModel(), [(body.joint, body.placement, body.geometry) for body in bodies(robot)]
    geometry += [(0, *solid) for one in obstacles for solid in one.solids()]
    for k, (joint, placement, shape) in enumerate(geometry):
        solids.addGeometryObject(pin.GeometryObject(str(k), joint, pin.SE3(placement), shape))
    for i, j in scene_geometry(robot, obstacles, True, ())[2]:
        solids.addCollisionPair(pin.CollisionPair(int(i), int(j)))
    data, found = robot.model.createData(), pin.GeometryData(solids)
    poses = np.random.default_rng(4).uniform(robot.limits.position_lower, robot.limits.position_upper, (40, robot.nv))
    hits = []
    for q, own in zip(poses, model.distances(poses), strict=True):
        pin.computeDistances(robot.model, data, solids, found, robot.configuration(q))
        expected = np.array([one.min_distance for one in found.distanceResults])
        np.testing.assert_allclose(own, expected, atol=2e-6)  # GJK's own tolerance, twice
        hits.append(bool(np.any(expected < 0)))
    assert 0 < sum(hits) < len(hits)
    assert [not model.is_free(q) for q in poses] == hits
    assert [not model.is_free(q) for q in poses[::-1]] == hits[::-1]  # whichever pair overlapped before


def test_another_version_of_coal_is_refused(monkeypatch):
    monkeypatch.setattr(coal, "__version__", "2.9.9")
    with pytest.raises(BridgeError, match=r"but coal 2\.9\.9 is installed"):
        CollisionModel(paper_arm("rr"), [Sphere((5, 0, 0), 0.1)])
