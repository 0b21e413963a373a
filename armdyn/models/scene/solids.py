"""An arm's bodies and obstacles as the numbers that `_collision/`, in C++, takes."""

from collections.abc import Sequence
from typing import Any

import coal
import numpy as np

from armdyn.arrays import Array, Index
from armdyn.errors import BridgeError
from armdyn.models.robots.robot import Robot
from armdyn.models.robots.tree import Tree
from armdyn.models.scene.bodies import ROUND_FINE, Body, balls_around

BALLS = 3
"""Balls along the axis of every link's capsule: with three a Panda's far pairs are told apart from its near ones."""
_INFINITE = 1e300
"""Ends of a box beyond this [m] are a half space's."""
_NONE = np.empty(0)


def compiled_scene(robot: Robot, solids: Sequence[dict[str, Any]], pairs: Index, touching: Index) -> Any:
    """The `Scene` of `_collision/scene.hpp`, for one thread.

    Args:
        robot: the arm.
        solids: its bodies, then obstacles.
        pairs: indices of the two solids of every pair, shape (pairs, 2); the first is a body.
        touching: indices of the pairs that may touch at the given poses, shape (m,).

    Raises:
        BridgeError: another version of coal is installed than the one that armdyn was built with.
    """
    import _armdyn_collision as collision

    if collision.coal_version != coal.__version__:
        raise BridgeError(
            f"armdyn was built with coal {collision.coal_version} but coal {coal.__version__} is installed: "
            f"reinstall armdyn, or coal=={collision.coal_version}"
        )
    ends = [(int(i), int(j)) for i, j in pairs]
    return collision.Scene(Tree.of(robot.model).arguments(), list(solids), ends, touching.tolist())


def body_solid(body: Body) -> dict[str, Any]:
    """A body of the arm, with balls around it."""
    a, b = (np.array(end) for end in (body.capsule.a, body.capsule.b))
    half_step = float(np.linalg.norm(b - a)) / (2 * BALLS)
    centers = a + (np.arange(BALLS) + 0.5)[:, None] / BALLS * (b - a)
    return {
        "shape": _shape(body.geometry),
        "joint": body.joint,
        "placement": _numbers(body.placement),
        "points": np.ascontiguousarray(body.points, dtype=float),
        "radius": float(body.radius),
        "outward": _NONE,
        "centers": np.ascontiguousarray(centers),
        "ball": body.capsule.radius + half_step,
        "box": _NONE,
    }


def obstacle_solid(placement: Array, geometry: Any) -> dict[str, Any]:
    """An obstacle, with a box around it along its own axes."""
    turn, at = placement[:3, :3], placement[:3, 3]
    geometry.computeLocalAABB()
    around = geometry.aabb_local
    ends = (np.where(np.abs(end) < _INFINITE, end, np.copysign(np.inf, end)) for end in (around.min_, around.max_))
    outward, radius = _NONE, 0.0
    if isinstance(geometry, coal.Halfspace):
        outward = np.ascontiguousarray(turn @ geometry.n)
        points = (at + geometry.d * outward)[None]
    else:
        points, radius = balls_around(geometry, ROUND_FINE)
        points = points @ turn.T + at
    return {
        "shape": _shape(geometry),
        "joint": 0,
        "placement": _numbers(placement),
        "points": np.ascontiguousarray(points),
        "radius": float(radius),
        "outward": outward,
        "centers": np.empty((0, 3)),
        "ball": 0.0,
        "box": np.concatenate(list(ends)),
    }


def _numbers(placement: Array) -> Array:
    """Rotation, row after row, then translation, of a placement of shape (4, 4)."""
    return np.concatenate([placement[:3, :3].ravel(), placement[:3, 3]])


def _shape(geometry: Any) -> Any:
    """A convex geometry of coal's Python as that of its C++."""
    import _armdyn_collision as collision

    if isinstance(geometry, coal.Box):
        return collision.shape("box", np.array(geometry.halfSide))
    if isinstance(geometry, coal.Sphere):
        return collision.shape("sphere", np.array([geometry.radius]))
    if isinstance(geometry, coal.Halfspace):
        return collision.shape("half space", np.append(geometry.n, geometry.d))
    for kind, name in ((coal.Capsule, "capsule"), (coal.Cylinder, "cylinder")):
        if isinstance(geometry, kind):
            return collision.shape(name, np.array([geometry.radius, geometry.halfLength]))
    return collision.shape("convex", np.array(geometry.points()))
