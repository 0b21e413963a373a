"""Solids of an arm and of obstacles for the C++ module in `_collision/`, and the pairs that could touch."""

from collections.abc import Collection, Sequence
from typing import Any

import coal
import numpy as np

from armdyn.arguments import shown
from armdyn.arrays import Array, Index
from armdyn.errors import BridgeError, ProblemError
from armdyn.locks import built_once
from armdyn.models.robots.robot import Robot
from armdyn.models.robots.tree import Tree
from armdyn.models.scene.bodies import ROUND_FINE, Body, balls_around, bodies, sizes_of
from armdyn.models.scene.obstacles import Obstacle

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
    """A body of the arm, with balls that contain it."""
    centers, ball = body.balls
    own = _solid(body.geometry, body.placement, body.points, body.radius)
    return own | {"joint": body.joint, "centers": np.ascontiguousarray(centers), "ball": ball}


def expected_solids(obstacle: Obstacle) -> list[tuple[Array, Any]]:
    """Solids of an obstacle.

    Raises:
        ProblemError: one is no pair of a placement and a geometry of coal.
    """
    solids = obstacle.solids()
    for solid in solids:
        pair = isinstance(solid, tuple) and len(solid) == 2
        if not (pair and np.shape(solid[0]) == (4, 4) and isinstance(solid[1], coal.CollisionGeometry)):
            raise ProblemError(
                f"a solid of {type(obstacle).__name__} is {shown(solid)}; it must be a placement of shape (4, 4) and a "
                "geometry of coal"
            )
    return solids


def obstacle_solid(placement: Array, geometry: Any) -> dict[str, Any]:
    """An obstacle, with a box around it along its own axes."""
    turn, at = placement[:3, :3], placement[:3, 3]
    geometry.computeLocalAABB()
    around = geometry.aabb_local
    ends = [np.where(np.abs(end) < _INFINITE, end, np.copysign(np.inf, end)) for end in (around.min_, around.max_)]
    box = {"box": np.concatenate(ends)}
    if isinstance(geometry, coal.Halfspace):
        outward = np.ascontiguousarray(turn @ geometry.n)
        return _solid(geometry, placement, (at + geometry.d * outward)[None], 0.0) | {"outward": outward} | box
    points, radius = balls_around(geometry, ROUND_FINE)
    return _solid(geometry, placement, points @ turn.T + at, radius) | box


def _solid(geometry: Any, placement: Array, points: Array, radius: float) -> dict[str, Any]:
    """Arguments common to all solids; the caller adds its joint, or world, and its bounding geometry."""
    import _armdyn_collision as collision

    return {
        "shape": collision.shape(*sizes_of(geometry)),
        "joint": 0,
        "placement": np.concatenate([placement[:3, :3].ravel(), placement[:3, 3]]),  # row after row
        "points": np.ascontiguousarray(points, dtype=float),
        "radius": float(radius),
        "outward": _NONE,
        "centers": np.empty((0, 3)),
        "ball": 0.0,
        "box": _NONE,
    }


_POSES = 60
_ALWAYS = 0.95
"""Part of the random poses: bodies that touch in at least this part touch by construction."""
_MOUNTED = 0.01
"""Distance [m]: tool or payload and the link on a neighbouring joint that are nearer in as many poses touch, too."""


def scene_geometry(
    robot: Robot, obstacles: Sequence[Obstacle], self_collision: bool, allowed: Collection[tuple[str, str]]
) -> tuple[list[str], list[dict[str, Any]], Index]:
    """Solids of a scene, and the pairs whose distance is computed.

    Pairs of links are those of `apart`; links that do not move are not compared with obstacles.

    Args:
        robot: the arm.
        obstacles: in the world.
        self_collision: whether pairs of links count.
        allowed: pairs of names, in any order, that may touch.

    Returns:
        Names of the link or obstacle that each solid is part of, the arm's first; the solids; indices of the two
        solids of every pair, shape (pairs, 2).

    Raises:
        ProblemError: the robot has no geometry, or a mesh of it cannot be read.
    """
    own, others = bodies(robot), [(one.name, solid) for one in obstacles for solid in expected_solids(one)]
    pairs = list(separable_pairs(robot)) if self_collision else []
    pairs += [(i, len(own) + k) for i, body in enumerate(own) if body.joint for k in range(len(others))]
    names = [*(body.name for body in own), *(name for name, _ in others)]
    touching = {frozenset(pair) for pair in allowed}
    kept = [(i, j) for i, j in pairs if frozenset((names[i], names[j])) not in touching]
    solids = [*_own_solids(robot), *(obstacle_solid(*solid) for _, solid in others)]
    return names, solids, np.array(kept, dtype=int).reshape(-1, 2)


@built_once(maxsize=16)
def _own_solids(robot: Robot) -> tuple[dict[str, Any], ...]:
    return tuple(body_solid(body) for body in bodies(robot))


@built_once(maxsize=16)
def separable_pairs(robot: Robot) -> tuple[tuple[int, int], ...]:
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
    scene = compiled_scene(robot, _own_solids(robot), np.array(candidates), np.empty(0, dtype=int))
    near = np.array([_MOUNTED if neighbours(*pair) else 0.0 for pair in candidates])
    random, limits = np.random.default_rng(0), robot.limits
    low, high = np.maximum(limits.position_lower, -np.pi), np.minimum(limits.position_upper, np.pi)
    low, high = np.minimum(low, high), np.maximum(low, high)
    share = np.mean(scene.distances(random.uniform(low, high, (_POSES, robot.nv)), _MOUNTED) <= near, axis=0)
    return tuple(pair for pair, often in zip(candidates, share, strict=True) if often < _ALWAYS)
