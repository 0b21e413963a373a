"""Lower bounds on the distances of a scene's pairs: balls around parts of the links, boxes around obstacles.

A few hundred bounds take a tenth of a millisecond; coal then computes the distances of the few pairs that are near.
"""

from typing import Any

import numpy as np

from armdyn.arrays import Array
from armdyn.models.scene.bodies import Body
from armdyn.models.scene.geometry import SceneGeometry

BALLS = 3
"""Balls along the axis of every link's capsule: with three a Panda's far pairs are told apart from its near ones."""
_INFINITE = 1e300
"""Ends of a box beyond this [m] are a half space's."""


class Balls:
    """Balls that contain the arm's bodies, and oriented boxes that contain the obstacles."""

    def __init__(self, own: tuple[Body, ...], scene: SceneGeometry):
        ends = np.array([[body.capsule.a, body.capsule.b] for body in own])
        part = (np.arange(BALLS) + 0.5) / BALLS
        half_step = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / (2 * BALLS)
        self._joints, self._pairs = np.array([body.joint for body in own]), scene.pairs
        # Of the balls in the joints' frames [m], shape (bodies, BALLS, 3) and (bodies,).
        self._centers = ends[:, :1] + part[:, None] * (ends[:, 1:] - ends[:, :1])
        self._radii = np.array([body.capsule.radius for body in own]) + half_step
        boxes = [_box(scene.model.geometryObjects[k]) for k in range(scene.links, len(scene.names))]
        rotations, places, lower, upper = zip(*boxes, strict=True) if boxes else ((), (), (), ())
        self._rotations = np.array(rotations).reshape(-1, 3, 3)
        # Places and ends of the boxes, along the obstacles' own axes; minus infinity for half spaces [m].
        self._places, self._lower, self._upper = (np.array(one).reshape(-1, 3) for one in (places, lower, upper))

    def bounds(self, rotations: Array, translations: Array) -> Array:
        """Lower bounds on the distances of all pairs at several poses [m], shape (poses, pairs).

        Args:
            rotations: of the joints in the world, shape (poses, joints, 3, 3).
            translations: likewise [m], shape (poses, joints, 3).
        """
        turned = self._centers @ rotations[:, self._joints].swapaxes(-1, -2)
        # Coordinates first: numpy is slow along short last axes.
        centers = np.moveaxis(turned + translations[:, self._joints, None], (3, 2, 1), (0, 1, 2))
        links = len(self._joints)
        first, second = self._pairs.T
        out, own = np.empty((centers.shape[-1], len(self._pairs))), second < links
        a, b = first[own], second[own]
        square = np.full((a.size, centers.shape[-1]), np.inf)
        for i, j in np.ndindex(BALLS, BALLS):
            gap = centers[:, i, a] - centers[:, j, b]
            np.minimum(square, gap[0] ** 2 + gap[1] ** 2 + gap[2] ** 2, out=square)
        out[:, own] = np.sqrt(square).T - self._radii[a] - self._radii[b]
        if len(self._places):
            away = self._away(np.ascontiguousarray(centers).reshape(3, -1)).reshape(-1, *centers.shape[1:])
            least = np.sqrt(np.min(away, axis=1)) - self._radii[:, None]
            out[:, ~own] = least[second[~own] - links, first[~own]].T
        return out

    def _away(self, points: Array) -> Array:
        """Squared distances of points from the boxes [m²], shape (boxes, points); points: shape (3, points)."""
        count = len(self._places)
        turned = self._rotations.swapaxes(1, 2).reshape(-1, 3)  # the rows of axis k of all boxes
        square = np.zeros((count, points.shape[1]))
        for k in range(3):
            axis = turned[k::3]
            inside = axis @ points
            at = np.sum(axis * self._places, axis=1)
            beyond = np.maximum((at + self._lower[:, k])[:, None] - inside, inside - (at + self._upper[:, k])[:, None])
            square += np.maximum(beyond, 0, out=beyond) ** 2
        return square


def _box(solid: Any) -> tuple[Array, Array, Array, Array]:
    """Rotation and place of an obstacle, and the lower and upper ends of its box along its own axes."""
    solid.geometry.computeLocalAABB()
    around, placement = solid.geometry.aabb_local, solid.placement
    ends = (np.where(np.abs(end) < _INFINITE, end, np.copysign(np.inf, end)) for end in (around.min_, around.max_))
    return np.array(placement.rotation), np.array(placement.translation), *ends
