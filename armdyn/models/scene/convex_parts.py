"""Convex parts that together contain a triangle mesh: it is cut by planes where that saves volume.

The hull of a mesh's surface on one side of a plane contains the surface there, and of a closed mesh also the solid, so
that the parts contain the mesh by construction. The hulls of V-HACD leave parts of a UR5's surface 18 mm outside.
"""

import io
from pathlib import Path
from typing import Any

import coal
import numpy as np

from armdyn.arrays import Array, Index
from armdyn.codegen.cache import stored

Surface = tuple[Array, Index]
"""Vertices [m], shape (m, 3), and the indices of each triangle's, shape (k, 3)."""

_SAVED = 0.03
"""Part of the whole hull's volume that cuts must save: with 0.03 a UR5 has 12 parts, at most 10 % larger than it is."""
_LOOSE = 1.25
"""Parts of more than this times a closed mesh's volume are halved, too: no single cut saves volume of a bin."""
_BLIND = 2
"""Halvings in a row that save nothing: a bin's quarters are the first whose hulls are smaller."""
_PLANES = 12
"""Places tried along each axis."""
_THICKNESS = 1e-4
"""Of a part that is flat [m]: a hull must have a volume."""
_DIRECTIONS = np.random.default_rng(0).normal(size=(64, 3))
"""The hull of a surface's farthest points in these directions has most of its volume, at a tenth of the time."""


def convex_parts(mesh: Any) -> list[Array]:
    """Corners of convex solids that together contain a mesh, each of shape (m, 3) [m]; its hull alone if it is convex.

    They are stored in the cache folder, if it is protected: cutting an arm's meshes takes seconds.

    Args:
        mesh: of trimesh.
    """
    surface: Surface = (np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64))
    content = b"".join((Path(__file__).read_bytes(), *(part.tobytes() for part in surface)))  # other code, other parts

    def packed() -> bytes:
        file = io.BytesIO()
        np.savez(file, *_cut(mesh, surface))
        return file.getvalue()

    with np.load(io.BytesIO(stored("convex_parts", content, packed)), allow_pickle=False) as arrays:
        return [arrays[name] for name in arrays.files]


def _cut(mesh: Any, whole: Surface) -> list[Array]:
    saved = _SAVED * hull_volume(whole[0])
    parts = cut_where_it_saves(whole, saved)
    if mesh.is_watertight and sum(hull_volume(part[0]) for part in parts) > _LOOSE * mesh.volume:
        parts = cut_where_it_saves(whole, saved, _BLIND)
    return [corners_of_hull(points) for points, _ in parts]


def cut_where_it_saves(part: Surface, saved: float, blind: int | None = None) -> list[Surface]:
    """Pieces of a part whose hulls save volume [m³], or the part alone; blind: halvings left, None: not to halve."""
    gain, axis, at = _best_plane(part)
    left = None if blind is None else _BLIND
    if gain <= saved:
        if not blind:
            return [part]
        low, high = np.min(part[0], axis=0), np.max(part[0], axis=0)
        axis, left = int(np.argmax(high - low)), blind - 1
        at = float(low[axis] + high[axis]) / 2
    pieces = [piece for half in _halves(part, axis, at) for piece in cut_where_it_saves(half, saved, left)]
    smaller = sum(hull_volume(piece[0]) for piece in pieces) <= hull_volume(part[0]) - saved
    return pieces if smaller else [part]


def _best_plane(part: Surface) -> tuple[float, int, float]:
    """Volume that the best cut saves, roughly [m³], the axis across it and the place along that axis [m]."""
    points, triangles = part
    whole, best = _rough_volume(points), (0.0, 0, 0.0)
    edges = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    for axis in range(3):
        along = points[:, axis]
        places = np.unique(np.round(along, 5))[1:-1]
        if places.size > _PLANES:  # corners near even places: a cut along a face saves most
            even = np.linspace(along.min(), along.max(), _PLANES + 2)[1:-1]
            places = np.unique(places[np.argmin(np.abs(places[:, None] - even), axis=0)])
        for at in places:
            first, second = along[edges].T - at
            crossing = first * second < 0
            share = (first[crossing] / (first[crossing] - second[crossing]))[:, None]
            a, b = points[edges[crossing]].transpose(1, 0, 2)
            rim = a + share * (b - a)
            sides = [np.vstack([points[side], rim]) for side in (along <= at, along >= at)]
            best = max(best, (whole - sum(map(_rough_volume, sides)), axis, float(at)))
    return best


def _halves(part: Surface, axis: int, at: float) -> list[Surface]:
    """Split a surface at a plane into two."""
    return [half for sign in (1, -1) if len((half := side_of_plane(part, axis, at, sign))[1])]


def side_of_plane(surface: Surface, axis: int, at: float, sign: int) -> Surface:
    """The part of a surface on one side of a plane across an axis: beyond it where the sign is 1, else before it."""
    import trimesh

    cut: Any = trimesh.intersections.slice_faces_plane
    normal = np.eye(3)[axis]
    points, triangles, _ = cut(*surface, plane_normal=sign * normal, plane_origin=at * normal)
    return points, triangles


def _rough_volume(points: Array) -> float:
    """Volume of the hull of the farthest points [m³], to compare cuts by."""
    return hull_volume(points[np.unique(np.argmax(points @ _DIRECTIONS.T, axis=0))])


def hull_volume(points: Array) -> float:
    """Volume of the hull of points, shape (m, 3) [m³]; 0 if they are flat."""
    from scipy.spatial import ConvexHull, QhullError  # loaded for meshes alone

    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):
        return 0.0


def corners_of_hull(points: Array) -> Array:
    """Corners of the hull of points, made thicker where it is flat."""
    from scipy.spatial import ConvexHull, QhullError  # loaded for meshes alone

    try:
        return np.asarray(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        cube = np.array(np.meshgrid(*([-0.5, 0.5],) * 3)).reshape(3, -1).T * _THICKNESS
        thick = (points[:, None] + cube).reshape(-1, 3)
        return np.asarray(thick[ConvexHull(thick).vertices])


def convex_hull(corners: Array) -> Any:
    """Geometry of coal around corners, shape (m, 3) [m]."""
    kept = coal.StdVec_Vec3s()
    kept.extend(list(corners))
    return coal.ConvexBase.convexHull(kept, True, "Qt")
