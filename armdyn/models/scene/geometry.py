"""Collision geometry of an arm among obstacles, as Pinocchio and coal take it, and the pairs that could touch."""

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array, Index
from armdyn.locks import built_once
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.bodies import Body, bodies
from armdyn.models.scene.obstacles import Obstacle

_POSES = 60
_ALWAYS = 0.95
"""Bodies that touch in this part of so many random poses, or more, are built so."""
_MOUNTED = 0.01
"""Tool or payload and the link on a neighbouring joint that are so near in as many poses are built so, too [m]."""


class SceneGeometry:
    """Solids and the pairs of them whose distance counts.

    Attributes:
        model: geometry of Pinocchio, with the pairs.
        names: of the link or obstacle that each solid is part of, in the order of `model.geometryObjects`.
        pairs: indices of the two solids of every pair, shape (pairs, 2).
        links: how many of the solids are the arm's; they come first.
    """

    def __init__(
        self,
        own: Sequence[Body],
        solids: Sequence[tuple[str, tuple[Array, Any]]],
        pairs: Sequence[tuple[int, int]],
        allowed: Collection[tuple[str, str]] = (),
    ):
        self.model, self.links = pin.GeometryModel(), len(own)
        for i, body in enumerate(own):
            placed = pin.GeometryObject(f"{i} {body.name}", body.joint, pin.SE3(body.placement), body.geometry)
            self.model.addGeometryObject(placed)
        for k, (_, (placement, geometry)) in enumerate(solids):
            self.model.addGeometryObject(pin.GeometryObject(f"obstacle {k}", 0, pin.SE3(placement), geometry))
        self.names = (*(body.name for body in own), *(name for name, _ in solids))
        touching = {frozenset(pair) for pair in allowed}
        kept = [(i, j) for i, j in pairs if frozenset((self.names[i], self.names[j])) not in touching]
        for i, j in kept:
            self.model.addCollisionPair(pin.CollisionPair(i, j))
        self.pairs: Index = np.array(kept, dtype=int).reshape(-1, 2)


def scene_geometry(
    robot: Robot,
    obstacles: Sequence[Obstacle] = (),
    self_collision: bool = False,
    allowed: Collection[tuple[str, str]] = (),
) -> SceneGeometry:
    """Build the geometry of a scene.

    Pairs of links are those of `apart`; links that do not move are not compared with obstacles.

    Args:
        robot: the arm.
        obstacles: in the world.
        self_collision: whether pairs of links count.
        allowed: pairs of names, in any order, that may touch.

    Raises:
        ProblemError: the robot has no geometry, or a mesh of it cannot be read.
    """
    own, solids = bodies(robot), [(one.name, solid) for one in obstacles for solid in one.solids()]
    pairs = list(apart(robot)) if self_collision else []
    pairs += [(i, len(own) + k) for i, body in enumerate(own) if body.joint for k in range(len(solids))]
    return SceneGeometry(own, solids, pairs, allowed)


@built_once(maxsize=16)
def apart(robot: Robot) -> tuple[tuple[int, int], ...]:
    """Pairs of the arm's bodies that can touch and need not.

    Bodies that touch in nearly all poses are built so. Of links on neighbouring joints that is assumed; tool and
    payload are compared with the links on neighbouring joints, too, unless these are next to them in nearly all poses.
    """
    own, parents = bodies(robot), robot.model.parents

    def neighbours(i: int, j: int) -> bool:
        a, b = own[i].joint, own[j].joint
        return bool(parents[a] == b or parents[b] == a)

    different = [(i, j) for j in range(len(own)) for i in range(j) if own[i].joint != own[j].joint]
    candidates = [(i, j) for i, j in different if own[i].attached or own[j].attached or not neighbours(i, j)]
    if not candidates:
        return ()
    scene = SceneGeometry(own, (), candidates)
    data, geometry = robot.model.createData(), pin.GeometryData(scene.model)
    for request, pair in zip(geometry.collisionRequests, candidates, strict=True):
        request.security_margin = _MOUNTED if neighbours(*pair) else 0.0
    random, limits = np.random.default_rng(0), robot.limits
    low, high = np.maximum(limits.position_lower, -np.pi), np.minimum(limits.position_upper, np.pi)
    low, high = np.minimum(low, high), np.maximum(low, high)
    count = np.zeros(len(candidates))
    for _ in range(_POSES):
        configuration = robot.configuration(random.uniform(low, high))
        pin.computeCollisions(robot.model, data, scene.model, geometry, configuration, False)
        count += [result.isCollision() for result in geometry.collisionResults]
    return tuple(pair for pair, share in zip(candidates, count / _POSES, strict=True) if share < _ALWAYS)
