"""How far an arm is from obstacles and from itself: coal, through Pinocchio, on the real geometry."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from armdyn.locks import built_once, one_at_a_time
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.bodies import Body, bodies
from armdyn.models.scene.obstacles import Obstacle
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_PIECES = 200
"""Of a motion, at least looked at."""
_POSES = 60
_ALWAYS = 0.95
"""Bodies that touch in this part of so many random poses, or more, are built so."""
_FINEST = 1e-4
"""Shortest step along a motion, as a part of it."""


@dataclass(frozen=True)
class Clearance:
    """Where a motion comes nearest to touching something.

    Attributes:
        distance: between the two bodies [m]; negative: they overlap.
        time: in the motion [s].
        body: name of the arm's link.
        other: of the obstacle, or of another link.
        sure: the arm moves less between two looks than it is away, so that no contact is missed.
    """

    distance: float
    time: float
    body: str
    other: str
    sure: bool = False

    def bodies(self) -> str:
        """The distance in words."""
        how = f"{1e3 * self.distance:.1f} mm from" if self.distance > 0 else f"{-1e3 * self.distance:.1f} mm inside"
        return f"{self.body!r} is {how} {self.other!r}"

    def __str__(self) -> str:
        return f"{self.bodies()} at t = {self.time:.4g} s"


class CollisionModel:
    """Distances between an arm's collision geometry, obstacles, and its own links, by coal.

    Links whose joints are neighbours are not compared, nor links that touch in 95 % of all poses: they are
    built so.

    Attributes:
        robot: the arm.
        obstacles: in the world.
        pairs: of names, in the order of `distances`.
    """

    def __init__(self, robot: Robot, obstacles: Sequence[Obstacle] = (), self_collision: bool = False):
        """Build the geometry.

        Raises:
            ProblemError: the robot has no geometry, or a mesh of it cannot be read.
        """
        self.robot, self.obstacles = robot, tuple(obstacles)
        own = bodies(robot)
        self._model = pin.GeometryModel()
        for i, body in enumerate(own):
            self._add(f"{i} {body.name}", body.joint, body.placement, body.geometry)
        for i, obstacle in enumerate(self.obstacles):
            self._add(f"obstacle {i}", 0, *obstacle.solid())
        indices: list[tuple[int, int]] = []
        if self_collision:
            indices += _apart(robot)
        indices += [(i, len(own) + k) for i, body in enumerate(own) if body.joint for k in range(len(self.obstacles))]
        self._connect(indices)
        names = [body.name for body in own] + [obstacle.name for obstacle in self.obstacles]
        self.pairs = tuple((names[i], names[j]) for i, j in indices)
        self._reach = _reach(robot, own)

    def _add(self, name: str, joint: int, placement: Array, geometry: Any) -> None:
        self._model.addGeometryObject(pin.GeometryObject(name, joint, pin.SE3(placement), geometry))

    def _connect(self, indices: Sequence[tuple[int, int]]) -> None:
        for i, j in indices:
            self._model.addCollisionPair(pin.CollisionPair(i, j))
        self._data, self._geometry = self.robot.model.createData(), pin.GeometryData(self._model)

    def distances(self, q: ArrayLike) -> Array:
        """Of every pair [m], shape (pairs,), at joint positions q [rad or m], shape (nv,); negative: they overlap."""
        configuration = self.robot.configuration(np.asarray(q))
        with one_at_a_time:  # the work space is the model's
            pin.computeDistances(self.robot.model, self._data, self._model, self._geometry, configuration)
            return np.array([result.min_distance for result in self._geometry.distanceResults])

    def nearest(self, q: ArrayLike, time: float = 0.0) -> Clearance:
        """The pair that is nearest at joint positions q [rad or m], shape (nv,)."""
        distances = self.distances(q)
        k = int(np.argmin(distances))
        return Clearance(float(distances[k]), time, *self.pairs[k])

    def along(self, motion: Trajectory) -> tuple[Clearance, Array]:
        """Where a motion comes nearest, and each pair's least distance [m], shape (pairs,).

        Steps are no longer than it takes the fastest point of the arm to get where the nearest thing is
        (conservative advancement, Mirtich 1996), a two-hundredth of the motion at most and a ten-thousandth
        at least.
        """
        start, end = float(motion.t[0]), float(motion.t[-1])
        fastest = self._speeds(motion)
        best = self.nearest(motion.q[0])
        least = np.full(len(self.pairs), np.inf)
        time, sure = start, True
        while True:
            distances = self.distances(motion(time).q)
            least = np.minimum(least, distances)
            k = int(np.argmin(distances))
            if distances[k] < best.distance:
                best = Clearance(float(distances[k]), time - start, *self.pairs[k])
            if time >= end:
                break
            # Two bodies of the arm may approach each other, hence half the way each.
            until = distances[k] / (2 * fastest) if fastest > 0 else np.inf
            shortest = _FINEST * (end - start)
            sure = bool(sure and until >= shortest)
            time = min(time + float(np.clip(until, shortest, (end - start) / _PIECES)), end)
        return Clearance(best.distance, best.time, best.body, best.other, sure), least

    def _speeds(self, motion: Trajectory) -> float:
        """No point of the arm is ever faster than this along a motion [m/s]."""
        return float(np.max(np.nan_to_num(np.abs(motion.v) @ self._reach, nan=np.inf)))


@built_once(maxsize=16)
def collision_model(robot: Robot, obstacles: tuple[Obstacle, ...], self_collision: bool) -> CollisionModel:
    """A `CollisionModel`, built once for the same arguments."""
    return CollisionModel(robot, obstacles, self_collision)


@built_once(maxsize=16)
def _apart(robot: Robot) -> tuple[tuple[int, int], ...]:
    """Pairs of the arm's bodies that can touch and need not: neither on neighbouring joints nor always touching."""
    own = bodies(robot)
    parents = robot.model.parents
    model = CollisionModel(robot)
    candidates = [
        (i, j)
        for j in range(len(own))
        for i in range(j)
        if own[i].joint != own[j].joint
        and parents[own[j].joint] != own[i].joint
        and parents[own[i].joint] != own[j].joint
    ]
    if not candidates:
        return ()
    model._connect(candidates)
    random = np.random.default_rng(0)
    limits = robot.limits
    low, high = np.maximum(limits.position_lower, -np.pi), np.minimum(limits.position_upper, np.pi)
    low, high = np.minimum(low, high), np.maximum(low, high)
    touching = np.mean([model.distances(random.uniform(low, high)) <= 0 for _ in range(_POSES)], axis=0)
    return tuple(pair for pair, share in zip(candidates, touching, strict=True) if share < _ALWAYS)


def _reach(robot: Robot, own: Sequence[Body]) -> Array:
    """How far from each joint anything that it moves can be [m], 1 for a sliding joint, shape (nv,)."""
    model = robot.model
    beyond = np.zeros(model.njoints)
    for body in own:
        ends = np.array([body.capsule.a, body.capsule.b])
        beyond[body.joint] = max(beyond[body.joint], float(np.max(np.linalg.norm(ends, axis=1))) + body.capsule.radius)
    slides = np.zeros(model.njoints, dtype=bool)
    for j in range(model.njoints - 1, 0, -1):
        slides[j] = bool(np.any(np.ravel(model.joints[j].createData().S)[:3]))
        slack = 0.0
        if slides[j]:
            ends = np.array([robot.limits.position_lower[j - 1], robot.limits.position_upper[j - 1]])
            slack = float(np.max(np.abs(ends)))
        parent = model.parents[j]
        step = float(np.linalg.norm(model.jointPlacements[j].translation))
        beyond[parent] = max(beyond[parent], beyond[j] + step + slack)
    return np.where(slides, 1.0, beyond)[1:]
