"""The arm's shapes as triangles, one mesh per joint and colour, and obstacles likewise."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
from meshcat import geometry as mg

from armdyn.arrays import Array
from armdyn.show.visuals import Rgba, VisualShape

_Y_UP = pin.SE3(pin.rpy.rpyToMatrix(-np.pi / 2, 0.0, 0.0), np.zeros(3)).homogeneous
"""trimesh has a cylinder's axis along z, three.js along y."""


@dataclass(frozen=True)
class JointMesh:
    """Triangles that move with a joint.

    Attributes:
        joint: index in `robot.model.joints`; 0 is the world.
        vertices: in the joint's frame [m], 32-bit floats of shape (n, 3).
        faces: indices of vertices, 32-bit integers of shape (m, 3).
        rgba: each 0..1.
    """

    joint: int
    vertices: Any
    faces: Any
    rgba: Rgba


def joint_meshes(shapes: Iterable[VisualShape]) -> list[JointMesh]:
    """Meshes of shapes: those of one joint and one colour are one mesh."""
    groups: dict[tuple[int, Rgba], list[VisualShape]] = {}
    for shape in shapes:
        groups.setdefault((shape.joint, shape.rgba), []).append(shape)
    return [_mesh(joint, rgba, group) for (joint, rgba), group in groups.items()]


def _mesh(joint: int, rgba: Rgba, group: list[VisualShape]) -> JointMesh:
    vertices, faces, first = [], [], 0
    for shape in group:
        points, triangles = _triangles(shape.geometry)
        vertices.append(points @ shape.placement[:3, :3].T + shape.placement[:3, 3])
        faces.append(np.asarray(triangles) + first)
        first += len(points)
    return JointMesh(joint, np.vstack(vertices).astype(np.float32), np.vstack(faces).astype(np.uint32), rgba)


def _triangles(geometry: Any) -> tuple[Array, Any]:
    """Vertices and faces of one of meshcat's geometries."""
    import trimesh

    if isinstance(geometry, mg.Box):
        solid = trimesh.creation.box(geometry.lengths)
        return solid.vertices[solid.faces.ravel()], np.arange(solid.faces.size).reshape(-1, 3)  # sharp edges
    if isinstance(geometry, mg.Sphere):
        solid = trimesh.creation.icosphere(subdivisions=3, radius=geometry.radius)
    elif isinstance(geometry, mg.Cylinder):
        solid = trimesh.creation.cylinder(geometry.radiusTop, geometry.height, sections=32)
        solid.apply_transform(_Y_UP)
        solid = trimesh.graph.smooth_shade(solid, angle=np.radians(35.0))
    else:
        return np.asarray(geometry.vertices, dtype=float), np.asarray(geometry.faces)
    return solid.vertices, solid.faces
