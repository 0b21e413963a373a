"""Obstacles as sensors measure them: point clouds and height maps, as few boxes of a grid."""

from __future__ import annotations

import io
import os
from dataclasses import KW_ONLY, dataclass
from pathlib import Path
from typing import Any, Self

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from armdyn.arguments import checked, number, numbers, path_of, text
from armdyn.arrays import Array, Index
from armdyn.errors import ProblemError
from armdyn.files import read_bounded
from armdyn.locks import built_once
from armdyn.models.scene.grid import MOST_BOXES, few_boxes
from armdyn.models.scene.shapes import Obstacle
from armdyn.models.values.placement import Placement, Point, homogeneous, point
from armdyn.reprs import brief

_MAX_BYTES = 64 * 2**20
_MAX_CELL_INDEX = 2**20
"""Largest distance from the origin, in cells."""
_MOST_CELLS = 2**26
"""Largest grid [bytes]."""


@brief
@dataclass(frozen=True)
class PointCloud(Obstacle):
    """Measured points: the world is divided into cubes, and those that hold a point are solid.

    Few boxes contain the cubes; they reach at most one cube further.

    Attributes:
        points: in the world [m], shape (n, 3); those with NaN, which cameras write where they saw nothing, are left
            out. Kept as the centres of the cubes that hold any.
        size: edge of the cubes [m]; the cubes' corners are at its multiples.
        name: in messages.
    """

    points: ArrayLike
    size: float = checked(number, unit="m", sign="positive")
    _: KW_ONLY
    name: str = "point cloud"

    def __post_init__(self) -> None:
        super().__post_init__()
        what = f"points of obstacle {self.name!r}"
        points = numbers(self.points, what, "points [m], shape (n, 3)")
        if points.ndim != 2 or points.shape[1] != 3:
            raise ProblemError(f"{what} have shape {points.shape}; it must be (n, 3)")
        points = points[~np.any(np.isnan(points), axis=1)]
        if not len(points) or not np.max(np.abs(points)) < _MAX_CELL_INDEX * self.size:
            far = f"reach {np.max(np.abs(points)):.4g} m, too far for a size of {self.size:g} m" if len(points) else ""
            raise ProblemError(f"{what} {far or 'are none, or all NaN'}")
        cells = np.unique(np.floor(points / self.size).astype(int), axis=0)
        # Rounded to a billionth of the size: shorter in files, and still inside of the same cubes.
        centres = np.round((cells + 0.5) * self.size, 9 - int(np.floor(np.log10(self.size))))
        object.__setattr__(self, "points", tuple(map(tuple, centres.tolist())))
        if (count := np.prod(np.ptp(cells, axis=0) + 3, dtype=float)) > _MOST_CELLS:
            raise ProblemError(f"{what} span {count:.2g} cubes: crop them to the arm's reach, or take a larger size")
        if len(_cloud_boxes(self)[0]) > MOST_BOXES:
            size = self.size
            while len(_boxes_of(cells)[0]) > MOST_BOXES:
                cells, size = np.unique(cells // 2, axis=0), 2 * size
            raise ProblemError(
                f"obstacle {self.name!r} is more than {MOST_BOXES} boxes with a size of {self.size:g} m: take "
                f"{size:g} m, or crop the cloud to the arm's reach"
            )

    @classmethod
    def from_file(
        cls,
        path: str | os.PathLike[str],
        size: float,
        placement: Placement = (0.0, 0.0, 0.0),
        *,
        name: str | None = None,
    ) -> Self:
        """Read the points of a file.

        Args:
            path: of a file .npy of shape (n, 3) or more columns; .xyz or .txt, a point per line; .ply; or .pcd in text.
            size: edge of the cubes [m].
            placement: of the points' frame, such as the camera's, in the world.
            name: in messages; None: the file's name.

        Raises:
            ProblemError: the file cannot be read, or has no points.
        """
        file = Path(path_of(path, "path of a point cloud"))
        name = file.stem if name is None else text(name, "name of an obstacle")
        pose = homogeneous(placement, f"placement of obstacle {name!r}")
        try:
            points = _points(read_bounded(file, _MAX_BYTES), file.suffix.lower())
        except Exception as error:  # any error of a foreign file
            raise ProblemError(f"obstacle {name!r}, {file}: {' '.join(str(error).split())[:300]}") from None
        return cls(points @ pose[:3, :3].T + pose[:3, 3], size, name=name)

    def solids(self) -> list[tuple[Array, Any]]:
        """Boxes that contain its cubes."""
        low, high = _cloud_boxes(self)
        return _placed(low * self.size, high * self.size)


@built_once(maxsize=16)
def _cloud_boxes(cloud: PointCloud) -> tuple[Index, Index]:
    return _boxes_of(np.floor(np.array(cloud.points) / cloud.size).astype(int))


def _boxes_of(cells: Index) -> tuple[Index, Index]:
    """Boxes that contain cells, shape (n, 3), and besides them only neighbours of theirs: `few_boxes`."""
    from scipy.ndimage import binary_dilation  # slow to import

    lowest = cells.min(axis=0) - 1
    solid = np.zeros(cells.max(axis=0) + 2 - lowest, dtype=bool)
    solid[tuple((cells - lowest).T)] = True
    low, high = few_boxes(solid, binary_dilation(solid))
    return low + lowest, high + lowest


@brief
@dataclass(frozen=True)
class HeightMap(Obstacle):
    """Columns on the cells of a grid in the xy plane, such as terrain or a bin seen from above.

    Few boxes contain the columns; they are at most one step higher.

    Attributes:
        heights: of the columns above the origin [m], shape (cells along x, cells along y); none where it is not
            positive. Kept rounded up to multiples of `step`.
        size: edge of the cells [m].
        origin: the corner of the first column at the lowest x, y and z, in the world [m].
        step: heights are rounded up to its multiples [m]: larger ones make fewer boxes.
        name: in messages.
    """

    heights: ArrayLike
    size: float = checked(number, unit="m", sign="positive")
    origin: Point = checked(point, (0.0, 0.0, 0.0))
    step: float = checked(number, 0.01, unit="m", sign="positive")
    _: KW_ONLY
    name: str = "height map"

    def __post_init__(self) -> None:
        super().__post_init__()
        what = f"heights of obstacle {self.name!r}"
        heights = numbers(self.heights, what, "heights [m], shape (nx, ny)")
        if heights.ndim != 2 or not np.all(np.abs(heights) < _MAX_CELL_INDEX * self.step):
            raise ProblemError(
                f"{what} have shape {heights.shape}; they must be finite, of shape (nx, ny), and not a million times "
                f"the step of {self.step:g} m: write the greatest height that is possible where it is unknown"
            )
        levels = np.maximum(np.ceil(heights / self.step - 1e-6), 0)
        if not np.any(levels):
            raise ProblemError(f"{what} are none: no column is higher than 0 by a millionth of the step")
        object.__setattr__(self, "heights", tuple(map(tuple, (levels * self.step).tolist())))
        if levels.size * np.max(levels) > _MOST_CELLS:
            raise ProblemError(f"{what} are {np.max(levels):.2g} times the step of {self.step:g} m: take a larger one")
        if len(_column_boxes(self)[0]) > MOST_BOXES:
            raise ProblemError(
                f"obstacle {self.name!r} is more than {MOST_BOXES} boxes: take a larger step than {self.step:g} m, or "
                "larger cells"
            )

    def solids(self) -> list[tuple[Array, Any]]:
        """Boxes that contain its columns."""
        scale = np.array([self.size, self.size, self.step])
        low, high = (ends * scale + self.origin for ends in _column_boxes(self))
        return _placed(low, high)


@built_once(maxsize=16)
def _column_boxes(ground: HeightMap) -> tuple[Index, Index]:
    """Boxes that contain the columns of a height map, at most a step higher. Indices of cells and steps."""
    levels = np.rint(np.array(ground.heights) / ground.step).astype(int)[:, :, None]
    steps = np.arange(int(levels.max()))
    return few_boxes(steps < levels, steps <= np.where(levels, levels, -1))


def _placed(low: Any, high: Any) -> list[tuple[Array, Any]]:
    """Boxes between corners in the world [m], shape (k, 3)."""
    boxes = zip((low + high) / 2, high - low, strict=True)
    return [(np.array(pin.SE3(np.eye(3), centre).homogeneous), coal.Box(*edges)) for centre, edges in boxes]


def _points(data: bytes, kind: str) -> Array:
    """Points of a file's content, shape (n, 3) [m]."""
    if kind == ".npy":
        return _columns(np.load(io.BytesIO(data), allow_pickle=False))
    if kind in (".xyz", ".txt"):
        return _columns(np.loadtxt(io.BytesIO(data), ndmin=2))
    if kind == ".pcd":
        head, found, body = data.partition(b"\nDATA ascii")
        if not found:
            raise ValueError("no PCD in text; pcl_convert_pcd_ascii_binary writes one")
        fields = next((line.split()[1:] for line in head.splitlines() if line.startswith(b"FIELDS")), [])
        at = [fields.index(axis) for axis in (b"x", b"y", b"z")]
        return _columns(np.loadtxt(io.BytesIO(body), ndmin=2, usecols=at))
    if kind == ".ply":
        import trimesh

        loaded: Any = trimesh.load(io.BytesIO(data), file_type="ply", process=False)
        return _columns(np.asarray(loaded.vertices))
    raise ValueError("a point cloud is a file .npy, .xyz, .txt, .ply or .pcd")


def _columns(values: Any) -> Array:
    """The first three columns; others are colours or intensities."""
    array = numbers(values, "its points")
    if array.ndim != 2 or array.shape[1] < 3:
        raise ValueError(f"its points have shape {array.shape}; it must be (n, 3)")
    return array[:, :3]
