"""Distances of an arm from obstacles and from itself, on the real geometry, by coal through Pinocchio."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from armdyn.arrays import Array, Index
from armdyn.locks import built_once, one_at_a_time
from armdyn.models.reading.urdf_arm import configurations
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.balls import Balls
from armdyn.models.scene.bodies import bodies
from armdyn.models.scene.geometry import scene_geometry
from armdyn.models.scene.obstacles import Obstacle
from armdyn.models.scene.separation import chain_of, gap, hulls
from armdyn.models.values.placement import Point

_BLOCK = 20_000
"""Pairs whose bounds are computed at once: a few megabytes."""
_TOUCHES = 5e-5
"""Bodies that are so near each other or overlap by so much touch, in words [m]."""


@dataclass(frozen=True)
class Clearance:
    """Smallest distance along a motion: its value, time and bodies.

    Attributes:
        distance: between the two bodies [m]; negative: they overlap.
        time: in the motion [s].
        body: name of the arm's link.
        other: of the obstacle, or of another link.
        sure: whether it is proven that every pair keeps the clearance asked for between the samples, too.
        points: the nearest points of the two bodies in the world [m]; None: not computed.
    """

    distance: float
    time: float
    body: str
    other: str
    sure: bool = False
    points: tuple[Point, Point] | None = None

    def bodies(self) -> str:
        """The distance in words."""
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
        scene = scene_geometry(robot, self.obstacles, self_collision, allowed)
        self.pairs = tuple((scene.names[i], scene.names[j]) for i, j in scene.pairs)
        known = {frozenset(pair) for pair in touching}
        self.touching = np.flatnonzero([frozenset(pair) in known for pair in self.pairs])
        self._scene, self._balls = scene, Balls(bodies(robot), scene)
        self._hulls = hulls(robot, scene)
        self.joints: Index = np.array([one.parentJoint for one in scene.model.geometryObjects], dtype=int)[scene.pairs]
        self._carried = np.zeros((robot.model.njoints, robot.model.nv))
        for joint in range(1, robot.model.njoints):
            self._carried[joint, np.array(chain_of(robot, joint)) - 1] = 1.0
        self._configuration = configurations(robot.model)
        self._data, self._geometry = robot.model.createData(), pin.GeometryData(scene.model)
        for k in self.touching:  # `is_free` compares their distances
            self._geometry.deactivateCollisionPair(int(k))
        self._broadphase = pin.BroadPhaseManager_DynamicAABBTreeCollisionManager(
            robot.model, scene.model, self._geometry
        )

    def is_free(self, q: ArrayLike, least: Array | float = 0.0) -> bool:
        """Whether no pair overlaps at joint positions q [rad or m], shape (nv,).

        Args:
            q: joint positions.
            least: distances of the `touching` pairs above which these count as free [m], one or shape (m,).
        """
        with one_at_a_time:  # the work space is the model's
            self._place(q)
            self._broadphase.update(False)
            if pin.computeCollisions(self._broadphase, True):
                return False
            return not self.touching.size or bool(np.all(self.distances_of(self.touching, q) >= least))

    def distances(self, q: ArrayLike, within: float = np.inf) -> Array:
        """Distances of all pairs.

        Args:
            q: joint positions [rad or m], shape (nv,), or of several poses, shape (poses, nv).
            within: a pair that is farther apart than this [m] may be given a lower bound on its distance, which is
                larger than this.

        Returns:
            Distances [m], shape (pairs,) or (poses, pairs); negative: they overlap.
        """
        poses = np.atleast_2d(np.asarray(q, dtype=float))
        with one_at_a_time:  # the work space is the model's
            out = self._bounds(poses)
            for here, pose in zip(out, poses, strict=True):
                self._measure(here, pose, within)
        return out if np.ndim(q) == 2 else out[0]

    def distances_of(self, pairs: Index, q: ArrayLike) -> Array:
        """Distances of some pairs [m], of the shape of their indices, at joint positions q [rad or m], shape (nv,)."""
        with one_at_a_time:
            self._place(q)
            for k in pairs:
                pin.computeDistance(self._scene.model, self._geometry, int(k))
            results = self._geometry.distanceResults
            return np.array([results[int(k)].min_distance for k in pairs])

    def gaps(self, pairs: Index, q: ArrayLike, v: ArrayLike, times: Array) -> Array:
        """Gaps of some pairs along their present normals if their points went on at their present velocities.

        Args:
            pairs: indices, shape (m,).
            q: joint positions [rad or m], shape (nv,).
            v: joint velocities [rad/s or m/s], shape (nv,).
            times: from now [s], shape (k,).

        Returns:
            [m], shape (m, k).
        """
        with one_at_a_time:
            self.distances_of(pairs, q)
            pin.forwardKinematics(self.robot.model, self._data, self._configuration(np.asarray(q)), np.asarray(v))
            normals = [np.array(self._geometry.distanceResults[int(k)].normal) for k in pairs]
            both = [(self._hulls[first], self._hulls[second]) for first, second in self._scene.pairs[pairs]]
            each = zip(both, normals, strict=True)
            return np.array([gap(self._data, self.robot.model, pair, normal, times) for pair, normal in each])

    def near(self, poses: Array, within: float, most: int) -> NearPairs:
        """The nearest pairs at several poses and how their distances change.

        Args:
            poses: joint positions [rad or m], shape (poses, nv).
            within: pairs no farther apart than this [m].
            most: so many pairs of a pose at most.
        """
        kept, found, jacobians = list[Index](), list[Array](), np.empty((len(poses), 6, self.robot.model.nv))
        points, results = list[Array](), self._geometry.distanceResults
        with one_at_a_time:
            for k, (here, pose) in enumerate(zip(self._bounds(poses), poses, strict=True)):
                near = self._measure(here, pose, within)
                near = near[np.argsort(here[near], kind="stable")][:most]
                kept.append(near[here[near] <= within])
                found.append(here[kept[-1]])
                jacobians[k] = pin.computeJointJacobians(self.robot.model, self._data)
                # coal's normal is a view of what the next pose overwrites
                points += [np.array((one.normal, one.getNearestPoint1(), one.getNearestPoint2()))
                           for one in (results[int(i)] for i in kept[-1])]  # fmt: skip
        which, pairs = np.repeat(np.arange(len(poses)), [one.size for one in kept]), np.concatenate(kept)
        gradients = self._gradients(pairs, np.array(points).reshape(-1, 3, 3), jacobians[which])
        return NearPairs(which, pairs, np.concatenate(found), gradients)

    def nearest(self, q: ArrayLike, time: float = 0.0) -> Clearance:
        """The pair that is nearest at joint positions q [rad or m], shape (nv,), at a time [s]."""
        with one_at_a_time:
            distances = self.distances(q)
            return self._clearance(int(np.argmin(distances)), time)

    def nearer(self, q: ArrayLike, than: float) -> tuple[Clearance, ...]:
        """Pairs of names that are nearer than a clearance and may not be, the nearest first.

        Args:
            q: joint positions [rad or m], shape (nv,).
            than: the clearance [m].
        """
        with one_at_a_time:
            distances = self.distances(q, than)
            distances[self.touching] = np.inf
            found = np.flatnonzero(distances < than)
            near = [self._clearance(int(k), 0.0) for k in found[np.argsort(distances[found], kind="stable")]]
        return tuple({(one.body, one.other): one for one in reversed(near)}.values())[::-1]

    def _clearance(self, k: int, time: float) -> Clearance:
        """The distance of a pair that coal computed last."""
        result = self._geometry.distanceResults[k]
        x, y = (tuple(map(float, point)) for point in (result.getNearestPoint1(), result.getNearestPoint2()))
        return Clearance(result.min_distance, time, *self.pairs[k], points=((x[0], x[1], x[2]), (y[0], y[1], y[2])))

    def _bounds(self, poses: Array) -> Array:
        """Lower bounds on the distances of all pairs at several poses [m], shape (poses, pairs)."""
        out, block = np.empty((len(poses), len(self.pairs))), 1 + _BLOCK // max(len(self.pairs), 1)
        frames = np.empty((len(poses), self.robot.model.njoints, 3, 4))
        for here, pose in zip(frames, poses, strict=True):
            pin.forwardKinematics(self.robot.model, self._data, self._configuration(pose))
            for k, frame in enumerate(self._data.oMi):
                here[k, :, :3], here[k, :, 3] = frame.rotation, frame.translation
        for first in range(0, len(poses), block):
            here = frames[first : first + block]
            out[first : first + block] = self._balls.bounds(here[..., :3], here[..., 3])
        return out

    def _measure(self, bounds: Array, pose: Array, within: float) -> Index:
        """Replace the bounds that are not larger than `within` by distances at a pose; their indices."""
        self._place(pose)
        near, results = np.flatnonzero(bounds <= within), self._geometry.distanceResults
        for k in near.tolist():
            pin.computeDistance(self._scene.model, self._geometry, k)
            bounds[k] = results[k].min_distance
        return near

    def _place(self, q: ArrayLike) -> None:
        configuration = self._configuration(np.asarray(q))
        pin.updateGeometryPlacements(self.robot.model, self._data, self._scene.model, self._geometry, configuration)

    def _gradients(self, pairs: Index, points: Array, jacobians: Array) -> Array:
        """Gradients of distances by q, shape (m, nv): the normals times the velocities of the nearest points.

        Args:
            pairs: indices, shape (m,).
            points: normal, nearest point of the first body and of the second [m], shape (m, 3, 3).
            jacobians: of the velocities of the world's origin and of the rotations, shape (m, 6, nv).
        """
        normal, out = points[:, 0], np.zeros((pairs.size, self.robot.model.nv))
        for side, sign in ((0, -1.0), (1, 1.0)):
            turning = np.cross(points[:, 1 + side], normal)  # n . (w x p) = (p x n) . w
            forward = np.einsum("mi,min->mn", np.concatenate([normal, turning], axis=1), jacobians)
            out += sign * self._carried[self.joints[pairs, side]] * forward
        return out


collision_model = built_once(maxsize=16)(CollisionModel)
"""A `CollisionModel`, built once for the same hashable arguments."""
