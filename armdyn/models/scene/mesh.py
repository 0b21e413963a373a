"""Obstacles of several convex solids: triangle meshes, cut into convex parts, and groups of other obstacles."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import checked, each, numbers, path_of, shown, text
from armdyn.arrays import Array
from armdyn.errors import ProblemError, reraised
from armdyn.models.reading.meshes import load_meshes
from armdyn.models.scene.convex_parts import convex_hull, convex_parts, hull_volume
from armdyn.models.scene.grid import hollow_parts
from armdyn.models.scene.shapes import Obstacle
from armdyn.models.values.placement import Placement, pose_rows
from armdyn.reprs import brief

MAX_TRIANGLES = 100_000
"""Most triangles of a mesh: cutting them takes up to half a minute."""
MAX_CORNERS = 20_000
"""Most corners of all convex parts of a mesh: proofs visit every one, and result files store them."""
_MAX_BYTES = 64 * 2**20
_LOOSE = 1.25
"""Ratio of the convex parts' volume to the body's, above which a grid is tried: its hollows would be filled."""
_MAX_COORDINATE = 100.0
"""Largest distance of a vertex from the mesh's origin along an axis [m]: a mesh beyond it is in millimetres."""


def _corners(part: object, name: str) -> tuple[tuple[float, ...], ...]:
    """Corners of a convex part as rows of three numbers [m]."""
    points = numbers(part, name, "corners [m], shape (m, 3)")
    if points.ndim != 2 or points.shape[1] != 3 or not np.all(np.isfinite(points)) or len(points) > MAX_CORNERS:
        raise ProblemError(
            f"{name} is {shown(part)}; it must be finite corners, shape (m, 3), of at most {MAX_CORNERS}"
        )
    if not hull_volume(points):
        raise ProblemError(f"{name} is flat: its {len(points)} corners enclose no volume")
    return tuple(map(tuple, points.tolist()))


@brief
@dataclass(frozen=True)
class Mesh(Obstacle):
    """A body of convex parts: a triangle mesh is cut into parts that contain it.

    Attributes:
        parts: corners of each convex part in the mesh's frame [m], each of shape (m, 3).
        placement: of the mesh's frame in the world: a position [m], shape (3,), or a pose, shape (4, 4) or `pin.SE3`.
            Kept as the rows of the homogeneous matrix.
        name: in messages.
    """

    parts: Sequence[ArrayLike] = checked(each, of=_corners)
    placement: Placement = checked(pose_rows, (0.0, 0.0, 0.0))
    _: KW_ONLY
    name: str = "mesh"

    def __post_init__(self) -> None:
        super().__post_init__()
        count = sum(map(len, self.parts))  # type: ignore[arg-type]  # tuples of corners now
        if not 0 < count <= MAX_CORNERS:
            raise ProblemError(
                f"the convex parts{self._of_whom()} have {count} corners; they may have 4 to {MAX_CORNERS}"
            )

    @classmethod
    def from_triangles(
        cls, vertices: ArrayLike, triangles: ArrayLike, placement: Placement = (0.0, 0.0, 0.0), *, name: str = "mesh"
    ) -> Self:
        """Cut a closed surface into convex parts that contain it and its inside.

        Args:
            vertices: in the mesh's frame [m], shape (m, 3).
            triangles: indices of the vertices of each, shape (k, 3).
            placement: of the mesh's frame in the world.
            name: in messages.

        Raises:
            ProblemError: the surface is open, too large, or no surface at all.
        """
        import trimesh

        what = f"obstacle {text(name, 'name of an obstacle')!r}"
        points, faces = numbers(vertices, f"vertices of {what}"), numbers(triangles, f"triangles of {what}")
        if points.ndim != 2 or points.shape[1] != 3 or not np.all(np.isfinite(points)):
            raise ProblemError(f"vertices of {what} have shape {points.shape}; they must be finite, of shape (m, 3)")
        whole = faces.ndim == 2 and faces.shape[1] == 3 and np.all(faces == np.round(faces))
        if not whole or not faces.size or np.min(faces) < 0 or np.max(faces) >= len(points):
            raise ProblemError(
                f"triangles of {what} have shape {faces.shape}; they must be indices of its {len(points)} vertices, "
                "of shape (k, 3)"
            )
        return cls(_cut([trimesh.Trimesh(points, faces.astype(int))], what), placement, name=name)

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        placement: Placement = (0.0, 0.0, 0.0),
        *,
        scale: float | ArrayLike = 1.0,
        name: str | None = None,
    ) -> Self:
        """Read a file of a closed surface, and cut it into convex parts that contain it and its inside.

        Args:
            path: of an STL, DAE, OBJ, PLY, OFF, GLB or glTF file.
            placement: of the mesh's frame in the world.
            scale: metres per unit of the file, one number or one per axis: 0.001 for millimetres.
            name: in messages; None: the file's name.

        Raises:
            ProblemError: the file cannot be read, or its surface is open or too large.
        """
        file = Path(path_of(path, "path of a mesh"))
        name = file.stem if name is None else text(name, "name of an obstacle")
        what = f"obstacle {name!r}, {file}"
        factors = numbers(scale, f"scale of {what}")
        if factors.shape not in ((), (3,)) or not np.all((factors > 0) & (factors < np.inf)):
            raise ProblemError(f"scale of {what} is {shown(scale)}; it must be one positive number or three")
        with reraised(ProblemError, what, Exception):  # any error of a foreign mesh
            found = [mesh for mesh, _ in load_meshes(file, np.broadcast_to(factors, 3), _MAX_BYTES)]
        return cls(_cut(found, what), placement, name=name)

    @property
    def pose(self) -> Array:
        """Homogeneous matrix of the mesh's frame in the world, shape (4, 4) [m]."""
        return np.array(self.placement)

    def solids(self) -> list[tuple[Array, Any]]:
        """Hulls of its parts."""
        return [(self.pose, convex_hull(np.array(part))) for part in self.parts]


def _cut(meshes: Sequence[Any], what: str) -> list[Array]:
    """Convex parts of closed meshes of trimesh."""
    if (count := sum(len(mesh.faces) for mesh in meshes)) > MAX_TRIANGLES:
        raise ProblemError(f"{what} has {count} triangles; it may have {MAX_TRIANGLES}: simplify the mesh")
    parts: list[Array] = []
    for mesh in meshes:
        if (largest := float(np.max(np.abs(mesh.vertices)))) > _MAX_COORDINATE:
            raise ProblemError(f"{what} reaches {largest:.4g} m; a mesh in millimetres is read with scale 0.001")
        if not mesh.is_watertight:
            edges = np.sum(np.unique(mesh.edges_sorted, axis=0, return_counts=True)[1] == 1)
            raise ProblemError(
                f"{what} is open, {edges} of its edges belong to one triangle only: its inside is unknown. Close the "
                "mesh, or use boxes or a point cloud"
            )
        for body in mesh.split(only_watertight=False):  # bodies of an assembly, such as the boards of a shelf
            found = convex_parts(body)
            if (volume := sum(map(hull_volume, found))) > _LOOSE * body.volume:
                better = hollow_parts(body)
                found = better if better and sum(map(hull_volume, better)) < volume else found
            parts += found
    return parts


def _member(value: object, name: str) -> Obstacle:
    if not isinstance(value, Obstacle) or isinstance(value, Group):
        raise ProblemError(f"{name} is {shown(value)}; it must be an obstacle, no group")
    return value


@brief
@dataclass(frozen=True)
class Group(Obstacle):
    """Several obstacles with one name, such as the boards of a shelf.

    Attributes:
        members: placed in the world; their names are not used.
        name: in messages.
    """

    members: Sequence[Obstacle] = checked(each, of=_member)
    _: KW_ONLY
    name: str = "group"

    def solids(self) -> list[tuple[Array, Any]]:
        """Solids of all members."""
        return [solid for one in self.members for solid in one.solids()]


def grouped(pieces: Sequence[Obstacle], name: str) -> Obstacle:
    """One obstacle of pieces that have its name: the only one, or their group."""
    return pieces[0] if len(pieces) == 1 else Group(pieces, name=name)
