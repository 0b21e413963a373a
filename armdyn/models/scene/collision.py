"""Distances of an arm from obstacles and from itself, on the real geometry, by coal (`_collision/`, in C++)."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array, Index
from armdyn.locks import built_once, one_at_a_time
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.geometry import compiled_scene, scene_geometry
from armdyn.models.scene.obstacles import Obstacle
from armdyn.models.values.placement import Point
from armdyn.trajectory import Trajectory

DEEPEST = 0.01
"""Largest overlap of bodies that may touch at a given pose [m]: convex parts of meshes are larger than these."""
_TOUCHES = 5e-5
"""Distance or overlap below which bodies touch, in words [m]."""


@dataclass(frozen=True)
class Clearance:
    """Smallest distance at the sampled times of a motion: its value, time and bodies.

    Attributes:
        distance: between the two bodies [m]; negative: they overlap. At times between, bodies may be nearer, but keep
            the clearance if that is `sure`.
        time: in the motion [s].
        body: name of the arm's link.
        other: of the obstacle, or of another link.
        sure: whether it is proven that every pair keeps the clearance between the samples, too.
        points: the nearest points of the two bodies in the world [m]; None: not computed.
    """

    distance: float
    time: float
    body: str
    other: str
    sure: bool = False
    points: tuple[Point, Point] | None = None

    def bodies(self) -> str:
        """The two bodies and their distance in words."""
        if abs(self.distance) < _TOUCHES:
            return f"{self.body!r} touches {self.other!r}"
        how = f"{1e3 * self.distance:.1f} mm from" if self.distance > 0 else f"{-1e3 * self.distance:.1f} mm inside"
        return f"{self.body!r} is {how} {self.other!r}"

    def __str__(self) -> str:
        return f"{self.bodies()} at t = {self.time:.4g} s"


@dataclass(frozen=True, eq=False)
class NearPairs:
    """Pairs of a scene that are near each other, pose by pose.

    Attributes:
        poses: index of the pose at which each is, shape (m,), not decreasing.
        pairs: their indices, shape (m,); of a pose the nearest first.
        distances: [m], shape (m,); negative: they overlap.
        gradients: of the distances by the joint positions [m/rad or m/m], shape (m, nv).
    """

    poses: Index
    pairs: Index
    distances: Array
    gradients: Array


class CollisionModel:
    """Distances between an arm's collision geometry, obstacles, and its own links.

    Attributes:
        robot: the arm.
        obstacles: in the world.
        pairs: of names, in the order of `distances`.
        touching: indices of the pairs that may touch at the given poses, shape (m,).
        joints: indices in `robot.model.joints` of the two joints that carry each pair, shape (pairs, 2); 0 is the
            world.
    """

    def __init__(
        self,
        robot: Robot,
        obstacles: Sequence[Obstacle] = (),
        self_collision: bool = False,
        allowed: Collection[tuple[str, str]] = (),
        touching: Collection[tuple[str, str]] = (),
    ):
        """Build the geometry.

        Args:
            robot: the arm.
            obstacles: in the world.
            self_collision: whether pairs of links count.
            allowed: pairs of names that may touch: they are not compared.
            touching: pairs of names that may touch at the given poses.

        Raises:
            ProblemError: the robot has no geometry, or a mesh of it cannot be read.
        """
        self.robot, self.obstacles = robot, tuple(obstacles)
        names, solids, pairs = scene_geometry(robot, self.obstacles, self_collision, allowed)
        self.pairs = tuple((names[i], names[j]) for i, j in pairs)
        known = {frozenset(pair) for pair in touching}
        self.touching = np.flatnonzero([frozenset(pair) in known for pair in self.pairs])
        self.joints: Index = np.array([one["joint"] for one in solids], dtype=int)[pairs]
        self._scene = compiled_scene(robot, solids, pairs, self.touching)

    def is_free(self, q: ArrayLike, least: Array | float = 0.0) -> bool:
        """Whether no pair overlaps at joint positions q [rad or m], shape (nv,).

        Args:
            q: joint positions.
            least: distances of the `touching` pairs above which these count as free [m], one or shape (m,).
        """
        with one_at_a_time:  # the work space is the scene's
            return bool(self._scene.first_hit(_poses(q), np.full(self.touching.shape, least)) == 1)

    def distances(self, q: ArrayLike, within: float = np.inf) -> Array:
        """Distances of all pairs.

        Args:
            q: joint positions [rad or m], shape (nv,), or of several poses, shape (poses, nv).
            within: a pair that is farther apart than this [m] may be given a lower bound on its distance, which is
                larger than this.

        Returns:
            Distances [m], shape (pairs,) or (poses, pairs); negative: they overlap.
        """
        with one_at_a_time:
            out: Array = self._scene.distances(_poses(q), within)
        return out if np.ndim(q) == 2 else out[0]

    def distances_of(self, pairs: Index, q: ArrayLike) -> Array:
        """Distances of some pairs [m], shape (pairs,) or (poses, pairs), at joint positions as of `distances`."""
        with one_at_a_time:
            out: Array = self._scene.distances_of(np.asarray(pairs, dtype=int), _poses(q))
        return out if np.ndim(q) == 2 else out[0]

    def near(self, poses: Array, within: float, most: int) -> NearPairs:
        """The nearest pairs at several poses and how their distances change.

        Args:
            poses: joint positions [rad or m], shape (poses, nv).
            within: pairs no farther apart than this [m].
            most: largest number of pairs of a pose.
        """
        with one_at_a_time:
            return NearPairs(*self._scene.near(_poses(poses), within, most))

    def plan(
        self,
        frame: Array,
        least: Array,
        random: tuple[Array, Array],
        lengths: tuple[float, float],
        checks: tuple[int, int],
        stop: Callable[[], bool],
    ) -> tuple[Array, int]:
        """Plan a collision-free path by RRT-Connect, in joint positions over joint speeds.

        Args:
            frame: start, goal, lower and upper bounds, and last the speeds [rad/s or m/s], shape (5, nv).
            least: see `is_free`, shape (m,).
            random: targets in the unit cube, shape (k, nv), and ends of shortcuts as parts of the path, shape (s, 2).
            lengths: between collision checks, in the largest component, and by which a tree grows at most [s].
            checks: budget of checks until a path is found, and the same for the shortcuts.
            stop: whether to give up, polled now and then.

        Returns:
            Points of the path [s], shape (points, nv), none if none was found; checks that were made.
        """
        with one_at_a_time:
            path, used = self._scene.plan(frame, least, *random, lengths, checks, stop)
        return path, used

    def prove(
        self, motion: Trajectory, bounds: tuple[Array, Array, Array], required: Array, work: tuple[int, int]
    ) -> tuple[Clearance, tuple[float, ...]]:
        """Prove that pairs keep their distances along a motion, or find times at which they do not.

        Args:
            motion: joints follow cubics between its samples.
            bounds: travel and acceleration as of `motion_bounds`, and the reach of every pair, shape (pairs, nv).
            required: distances to be kept [m], shape (pairs,).
            work: equal parts of the motion at the start, and the most bisections.

        Returns:
            The nearest pair, `sure` if all keep their distances; times at which a pair is nearer [s], increasing.
        """
        travel, acceleration, reach = bounds
        rows = (motion.t, motion.q, motion.v, travel, acceleration, required, reach)
        with one_at_a_time:
            sure, missed, pair, time = self._scene.prove(*(np.ascontiguousarray(row) for row in rows), *work)
            nearest = self._clearance(pair, motion(time).q, time)
        return replace(nearest, sure=sure), tuple(missed.tolist())

    def nearer(self, q: ArrayLike, than: float) -> tuple[Clearance, ...]:
        """Smallest distance of every pair of names that is nearer than a clearance and may not be, the nearest first.

        Pairs that may touch overlap by `DEEPEST` at most.

        Args:
            q: joint positions [rad or m], shape (nv,).
            than: the clearance [m].
        """
        distances = self.distances(q, than)
        least = np.full(distances.size, than)
        least[self.touching] = -DEEPEST
        found = np.flatnonzero(distances < least)
        nearest = dict[tuple[str, str], Clearance]()
        for k in found[np.argsort(distances[found], kind="stable")]:
            nearest.setdefault(self.pairs[k], self._clearance(int(k), q, 0.0))
        return tuple(nearest.values())

    def _clearance(self, k: int, q: ArrayLike, time: float) -> Clearance:
        """The distance of a pair at joint positions."""
        with one_at_a_time:
            distance, points = self._scene.witness(k, _poses(q))
        x, y = points.tolist()
        return Clearance(distance, time, *self.pairs[k], points=((x[0], x[1], x[2]), (y[0], y[1], y[2])))


def _poses(q: ArrayLike) -> Array:
    """Joint positions as a contiguous array for C++, shape (poses, nv)."""
    return np.atleast_2d(np.ascontiguousarray(q, dtype=float))


collision_model = built_once(maxsize=16)(CollisionModel)
"""A `CollisionModel`, built once for the same hashable arguments."""
