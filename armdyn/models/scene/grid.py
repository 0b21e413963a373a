"""Grids of cells: few boxes that contain solid ones, and convex parts of hollow bodies by them."""

from collections.abc import Sequence
from itertools import pairwise, permutations, product
from typing import Any

import numpy as np

from armdyn.arrays import Array, Flags, Index
from armdyn.models.scene.convex_parts import Surface, corners_of_hull, cut_where_it_saves, side_of_plane

MOST_BOXES = 1000
"""Most boxes of a point cloud or a height map: a Panda's solve takes 2 s among 40 of them, 7 s among 900."""

_ALIGNED = 16
"""Planes across each axis through faces of a mesh, those of the largest area."""
_EVEN = 8
"""Parts of its length that the planes divide at least, where no face is."""
_SAVED = 0.005
"""Part of the whole hull's volume that further cuts of the surface in a box of cells must save."""
_EDGE = 1e-6
"""Tolerance of planes [m]: a smaller penetration is no crossing; parts are larger by it."""


def few_boxes(solid: Flags, allowed: Flags) -> tuple[Index, Index]:
    """Few boxes of cells of a grid that contain all solid cells, and none that is not allowed.

    Every box grows from a cell that no other box contains along one axis after the other, as far as is allowed, and is
    then cut to the cells that it adds; of the orders of the axes the one that adds most is taken. More boxes than
    `MOST_BOXES` are not looked for.

    Args:
        solid: shape (nx, ny, nz).
        allowed: likewise; True for all solid cells.

    Returns:
        Lowest index of each box, and highest plus one, each of shape (k, 3).
    """
    left = solid.copy()
    found: list[Any] = []
    while len(found) <= MOST_BOXES and left.flat[(first := int(np.argmax(left)))]:
        best: tuple[int, Any, Any] = (0, None, None)
        for order in permutations(range(3)):
            low = np.array(np.unravel_index(first, left.shape))
            high = low + 1
            for axis in order:
                across = [slice(a, b) for a, b in zip(low, high, strict=True)]
                across[axis] = slice(None)
                blocked = np.flatnonzero(~allowed[tuple(across)].all(axis=tuple({0, 1, 2} - {axis})))
                at = int(np.searchsorted(blocked, low[axis]))
                low[axis] = blocked[at - 1] + 1 if at else 0
                high[axis] = blocked[at] if at < blocked.size else left.shape[axis]
            added = np.argwhere(left[tuple(map(slice, low, high))])
            if len(added) > best[0]:
                best = len(added), low + added.min(axis=0), low + added.max(axis=0) + 1
        _, low, high = best
        left[tuple(map(slice, low, high))] = False
        found.append((low, high))
    ends = np.array(found, dtype=int).reshape(-1, 2, 3)
    return ends[:, 0], ends[:, 1]


def hollow_parts(mesh: Any) -> list[Array]:
    """Corners of convex solids that together contain a closed mesh of trimesh, each of shape (m, 3) [m]; [] if many.

    A grid has planes through the mesh's faces that are parallel to its axes, so that a shelf, a bin or a frame of
    boards falls into its boards. Every solid is the hull of the surface in a box of cells and of the cells in it that
    are inside the body; where none is, the surface is cut further as `convex_parts` does.
    """
    triangles: Array = np.asarray(mesh.triangles)
    planes = [_planes(mesh, axis) for axis in range(3)]
    touched, inside = _cells(triangles, np.asarray(mesh.face_normals), planes)
    boxes = few_boxes(touched | inside, touched | inside)
    if len(boxes[0]) > MOST_BOXES:
        return []
    saved, parts = _SAVED * float(mesh.convex_hull.volume), []
    for low, high in zip(*boxes, strict=True):
        within = np.argwhere(inside[tuple(map(slice, low, high))]) + low
        surface = _clipped((np.asarray(mesh.vertices), np.asarray(mesh.faces)), planes, low, high)
        if len(within):  # of the cells inside, the corners
            solid = (within[:, None] + np.array(list(product((0, 1), repeat=3)))).reshape(-1, 3)
            cells = np.column_stack([planes[axis][solid[:, axis]] for axis in range(3)])
            parts.append(corners_of_hull(np.vstack([cells, surface[0]])))
        elif len(surface[1]):
            parts += [corners_of_hull(points) for points, _ in cut_where_it_saves(surface, saved)]
    return parts


def _planes(mesh: Any, axis: int) -> Array:
    """Positions of the grid's planes along an axis [m], increasing: at faces, and evenly between them."""
    across = np.abs(mesh.face_normals[:, axis]) > 1 - 1e-9
    places = np.round(mesh.triangles[across][:, 0, axis] / _EDGE).astype(int)
    known, which = np.unique(places, return_inverse=True)
    area = np.bincount(which.ravel(), weights=mesh.area_faces[across], minlength=len(known))
    low, high = mesh.bounds[:, axis]
    ends = known[np.argsort(-area, kind="stable")[:_ALIGNED]] * _EDGE
    found = np.unique(np.clip([low, *ends.tolist(), high], low, high))
    steps = [np.linspace(a, b, max(int(_EVEN * (b - a) / (high - low)), 1) + 1)[:-1] for a, b in pairwise(found)]
    return np.append(np.concatenate(steps), high)


def _cells(triangles: Array, normals: Array, planes: Sequence[Array]) -> tuple[Flags, Flags]:
    """Masks of the cells that the surface may cross, and of the others inside it.

    Args:
        triangles: corners [m], shape (k, 3, 3).
        normals: shape (k, 3).
        planes: places of the grid's planes along each axis [m].
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    x, y, z = planes
    touched = np.zeros([len(one) - 1 for one in planes], dtype=bool)
    inside = touched.copy()
    for i, j in product(range(len(x) - 1), range(len(y) - 1)):
        near = np.ones(len(low), dtype=bool)
        for axis, (start, end) in enumerate(((x[i], x[i + 1]), (y[j], y[j + 1]))):
            near &= (low[:, axis] < end - _EDGE) & (high[:, axis] > start + _EDGE)
        some, across, corner = np.flatnonzero(near), normals[near], triangles[near, 0]
        # No corner and no diagonal of a drawing lies there.
        at = np.array([x[i] + 0.4786 * (x[i + 1] - x[i]), y[j] + 0.5271 * (y[j + 1] - y[j])])
        crossings = _crossings(triangles[near], at)
        for k in range(len(z) - 1):
            half = np.array([x[i + 1] - x[i], y[j + 1] - y[j], z[k + 1] - z[k]]) / 2
            centre = np.array([x[i], y[j], z[k]]) + half
            away = np.abs(np.sum(across * (centre - corner), axis=1))
            cut = (low[some, 2] < z[k + 1] - _EDGE) & (high[some, 2] > z[k] + _EDGE)
            touched[i, j, k] = np.any(cut & (away < np.abs(across) @ half - _EDGE))
            inside[i, j, k] = np.sum(crossings > centre[2]) % 2 and not touched[i, j, k]
    return touched, inside


def _crossings(triangles: Array, at: Array) -> Array:
    """Heights at which a vertical line at (x, y) crosses triangles, shape (k, 3, 3) [m]."""
    a, b, c = (triangles[:, k, :2] for k in range(3))
    doubled = _area(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):  # upright triangles are crossed nowhere
        shares = np.array([_area(c - b, at - b), _area(a - c, at - c), _area(b - a, at - a)]).T / doubled[:, None]
        crossed = np.all(shares > 0, axis=1) & (doubled != 0)
    return np.asarray(np.sum(shares[crossed] * triangles[crossed, :, 2], axis=1))


def _area(a: Array, b: Array) -> Array:
    """Signed areas of parallelograms in the plane, of sides of shape (k, 2)."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _clipped(surface: Surface, planes: Sequence[Array], low: Index, high: Index) -> Surface:
    """The surface in a box of cells."""
    for axis, (first, last) in enumerate(zip(low, high, strict=True)):
        for sign, place in ((1, planes[axis][first] - _EDGE), (-1, planes[axis][last] + _EDGE)):
            if len(surface[1]):
                surface = side_of_plane(surface, axis, place, sign)
    return surface
