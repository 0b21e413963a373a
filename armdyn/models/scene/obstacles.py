"""Obstacles: spheres, capsules and boxes that stand in the world."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from armdyn.arguments import number, numbers, shown, text
from armdyn.errors import FileError, ProblemError
from armdyn.files import read_json

Array = NDArray[np.float64]
Point = tuple[float, float, float]
Placement: TypeAlias = ArrayLike | pin.SE3
"""A position [m], shape (3,), or a pose, shape (4, 4) or `pin.SE3`."""

_MAX_FILE = 2**20
_LONGEST_NAME = 200


def _point(value: ArrayLike, what: str) -> Point:
    array = numbers(value, what, "three numbers")
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise ProblemError(f"{what} is {shown(value)}; it must be three finite numbers")
    x, y, z = (float(part) for part in array)
    return x, y, z


def _positive(value: float, what: str) -> float:
    return number(value, what, unit="m", sign="positive")


@dataclass(frozen=True)
class Sphere:
    """A ball.

    Attributes:
        center: in the world [m].
        radius: [m].
        name: what messages call it.
    """

    center: Point
    radius: float
    _: KW_ONLY
    name: str = "sphere"

    def __post_init__(self) -> None:
        text(self.name, "name of an obstacle")
        object.__setattr__(self, "center", _point(self.center, f"center of obstacle {self.name!r}"))
        object.__setattr__(self, "radius", _positive(self.radius, f"radius of obstacle {self.name!r}"))


@dataclass(frozen=True)
class Capsule:
    """All points within a radius of a segment: a cylinder with round ends.

    Attributes:
        a: one end of the segment, in the world [m].
        b: its other end [m].
        radius: [m].
        name: what messages call it.
    """

    a: Point
    b: Point
    radius: float
    _: KW_ONLY
    name: str = "capsule"

    def __post_init__(self) -> None:
        text(self.name, "name of an obstacle")
        for end in ("a", "b"):
            object.__setattr__(self, end, _point(getattr(self, end), f"{end} of obstacle {self.name!r}"))
        object.__setattr__(self, "radius", _positive(self.radius, f"radius of obstacle {self.name!r}"))


@dataclass(frozen=True)
class Box:
    """A cuboid.

    Attributes:
        size: full edge lengths along its own axes [m].
        placement: of its centre in the world: a position [m], shape (3,), or a pose, shape (4, 4) or `pin.SE3`.
            Kept as the rows of the homogeneous matrix.
        name: what messages call it.
    """

    size: Point
    placement: Placement
    _: KW_ONLY
    name: str = "box"

    def __post_init__(self) -> None:
        text(self.name, "name of an obstacle")
        size = _point(self.size, f"size of obstacle {self.name!r}")
        for edge in size:
            _positive(edge, f"an edge of obstacle {self.name!r}")
        object.__setattr__(self, "size", size)
        pose = homogeneous(self.placement, f"placement of obstacle {self.name!r}")
        object.__setattr__(self, "placement", tuple(map(tuple, pose.tolist())))

    @property
    def pose(self) -> Array:
        """Homogeneous matrix of its centre in the world, shape (4, 4) [m]."""
        return np.array(self.placement)


Obstacle = Sphere | Capsule | Box


def homogeneous(placement: Placement, what: str) -> Array:
    """A position, shape (3,), or a pose, shape (4, 4) or `pin.SE3`, as a matrix of shape (4, 4) [m].

    Raises:
        ProblemError: it is none of these, or its rotation is no rotation.
    """
    if isinstance(placement, pin.SE3):
        return np.array(placement.homogeneous)
    wanted = "a position (3 numbers), a 4 × 4 matrix or a pinocchio.SE3"
    array = numbers(placement, what, wanted)
    pose = np.eye(4)
    if array.shape == (3,):
        pose[:3, 3] = array
    elif array.shape == (4, 4):
        pose = array.copy()
    else:
        raise ProblemError(f"{what} has shape {array.shape}; it must be {wanted}")
    if not np.all(np.isfinite(pose)):
        raise ProblemError(f"{what} is not finite")
    rotation = pose[:3, :3]
    # 1e-6: a matrix typed with seven digits is a rotation.
    with np.errstate(over="ignore", invalid="ignore"):  # a matrix of huge numbers is none
        turned = np.max(np.abs(rotation.T @ rotation - np.eye(3)))
    if not turned <= 1e-6 or np.linalg.det(rotation) < 0:
        raise ProblemError(f"{what} has a rotation that is none: {rotation.tolist()}")
    return pose


def pose_of(position: ArrayLike, quaternion: ArrayLike | None, rpy: ArrayLike | None, what: str) -> Array:
    """A pose from a position [m] and a quaternion (x, y, z, w) or roll, pitch, yaw [rad], shape (4, 4).

    Raises:
        ProblemError: both, wrong length, not finite, or a quaternion of no length.
    """
    pose = np.eye(4)
    pose[:3, 3] = _point(position, f"position of {what}")
    if quaternion is not None and rpy is not None:
        raise ProblemError(f"{what} has a quaternion and rpy; give one of them")
    if rpy is not None:
        pose[:3, :3] = pin.rpy.rpyToMatrix(np.array(_point(rpy, f"rpy of {what}")))
    if quaternion is not None:
        q = numbers(quaternion, f"quaternion of {what}", "four numbers x, y, z, w")
        with np.errstate(over="ignore"):
            length = np.linalg.norm(q)
        if q.shape != (4,) or not 1e-9 < length < np.inf:
            raise ProblemError(
                f"quaternion of {what} is {shown(quaternion)}; it must be four numbers x, y, z, w, not all 0"
            )
        pose[:3, :3] = pin.Quaternion(*np.roll(q / length, 1)).toRotationMatrix()
    return pose


_KEYS = {
    "sphere": ({"center", "radius"}, {"name"}),
    "capsule": ({"a", "b", "radius"}, {"name"}),
    "box": ({"size", "position"}, {"rpy", "quaternion", "name"}),
}


def obstacle_from(entry: Mapping[str, Any], where: str) -> Obstacle:
    """An obstacle from what a JSON file says, such as {"type": "box", "size": […], "position": […], "rpy": […]}.

    Raises:
        ProblemError: an unknown type, or a number that is missing, superfluous or wrong.
    """
    kind = entry.get("type") if isinstance(entry, Mapping) else None
    if not isinstance(kind, str) or kind not in _KEYS:
        raise ProblemError(f'{where}: "type" is {shown(kind)}; it must be one of {", ".join(_KEYS)}')
    needed, allowed = _KEYS[kind]
    given = set(entry) - {"type"}
    if needed - given or given - needed - allowed:
        raise ProblemError(
            f"{where}: a {kind} has {', '.join(sorted(needed))}, and may have {', '.join(sorted(allowed))}; "
            f"given: {shown(sorted(given)) if given else 'nothing'}"
        )
    name = str(entry.get("name", kind))
    if len(name) > _LONGEST_NAME:
        raise ProblemError(f"{where}: its name has {len(name)} characters; it may have {_LONGEST_NAME}")
    try:
        if kind == "sphere":
            return Sphere(entry["center"], entry["radius"], name=name)
        if kind == "capsule":
            return Capsule(entry["a"], entry["b"], entry["radius"], name=name)
        pose = pose_of(entry["position"], entry.get("quaternion"), entry.get("rpy"), f"obstacle {name!r}")
        return Box(entry["size"], pose, name=name)
    except ProblemError as error:
        raise ProblemError(f"{where}: {error}") from None


def obstacle_entry(obstacle: Obstacle) -> dict[str, Any]:
    """An obstacle as `obstacle_from` takes it, and JSON says it."""
    if isinstance(obstacle, Sphere):
        return {"type": "sphere", "center": list(obstacle.center), "radius": obstacle.radius, "name": obstacle.name}
    if isinstance(obstacle, Capsule):
        ends = {"a": list(obstacle.a), "b": list(obstacle.b)}
        return {"type": "capsule", **ends, "radius": obstacle.radius, "name": obstacle.name}
    turned = not np.array_equal(obstacle.pose[:3, :3], np.eye(3))
    return {
        "type": "box",
        "size": list(obstacle.size),
        **pose_entry(obstacle.pose, turned=turned),
        "name": obstacle.name,
    }


def pose_entry(pose: Array, *, turned: bool) -> dict[str, list[float]]:
    """A pose, shape (4, 4) [m], by the names that `pose_of` has for it; with its quaternion (x, y, z, w) if turned."""
    position = {"position": pose[:3, 3].tolist()}
    return position | ({"quaternion": pin.Quaternion(pose[:3, :3]).coeffs().tolist()} if turned else {})


def load_obstacles(path: str | os.PathLike[str]) -> tuple[Obstacle, ...]:
    """Obstacles from a JSON file: a list of objects as `obstacle_from` takes them.

    Raises:
        ProblemError: the file cannot be read, or says something else.
    """
    try:
        entries = read_json(path, _MAX_FILE)
    except FileError as error:
        raise ProblemError(f"no file of obstacles: {error}") from None
    if not isinstance(entries, Sequence) or isinstance(entries, str) or not entries:
        raise ProblemError(f"{path}: must be a list of obstacles, each an object with a type")
    return tuple(obstacle_from(entry, f"{path}, obstacle {i}") for i, entry in enumerate(entries, start=1))
