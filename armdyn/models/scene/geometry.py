"""Solids of an arm among obstacles, and the pairs of them that could touch."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from armdyn.arrays import Index
from armdyn.locks import built_once
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.bodies import bodies
from armdyn.models.scene.obstacles import Obstacle
from armdyn.models.scene.solids import body_solid, compiled_scene, obstacle_solid

_POSES = 60
_ALWAYS = 0.95
"""Bodies that touch in this part of so many random poses, or more, are built so."""
_MOUNTED = 0.01
"""Tool or payload and the link on a neighbouring joint that are so near in as many poses are built so, too [m]."""


@dataclass(frozen=True, eq=False)
class SceneGeometry:
    """Solids and the pairs of them whose distance counts.

    Attributes:
        names: of the link or obstacle that each solid is part of; the arm's come first.
        solids: as of `solids.py`, likewise.
        pairs: indices of the two solids of every pair, shape (pairs, 2).
    """

    names: tuple[str, ...]
    solids: tuple[dict[str, Any], ...]
    pairs: Index


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
    own, others = bodies(robot), [(one.name, solid) for one in obstacles for solid in one.solids()]
    pairs = list(apart(robot)) if self_collision else []
    pairs += [(i, len(own) + k) for i, body in enumerate(own) if body.joint for k in range(len(others))]
    names = (*(body.name for body in own), *(name for name, _ in others))
    touching = {frozenset(pair) for pair in allowed}
    kept = [(i, j) for i, j in pairs if frozenset((names[i], names[j])) not in touching]
    solids = (*_own_solids(robot), *(obstacle_solid(*solid) for _, solid in others))
    return SceneGeometry(names, solids, np.array(kept, dtype=int).reshape(-1, 2))


@built_once(maxsize=16)
def _own_solids(robot: Robot) -> tuple[dict[str, Any], ...]:
    return tuple(body_solid(body) for body in bodies(robot))


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
    scene = compiled_scene(robot, _own_solids(robot), np.array(candidates), np.empty(0, dtype=int))
    near = np.array([_MOUNTED if neighbours(*pair) else 0.0 for pair in candidates])
    random, limits = np.random.default_rng(0), robot.limits
    low, high = np.maximum(limits.position_lower, -np.pi), np.minimum(limits.position_upper, np.pi)
    low, high = np.minimum(low, high), np.maximum(low, high)
    share = np.mean(scene.distances(random.uniform(low, high, (_POSES, robot.nv)), _MOUNTED) <= near, axis=0)
    return tuple(pair for pair, often in zip(candidates, share, strict=True) if often < _ALWAYS)
