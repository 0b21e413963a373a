"""Obstacles: spheres, capsules, cylinders, boxes and half spaces that stand in the world."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, fields
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from armdyn.arguments import number, shown, text
from armdyn.errors import FileError, ProblemError
from armdyn.files import read_json
from armdyn.models.values.placement import Placement, Point, homogeneous, point, pose_entry, pose_of

Array = NDArray[np.float64]

_MAX_FILE = 2**20
_LONGEST_NAME = 200


class Obstacle(ABC):
    """A convex solid that stands in the world, or part of what an arm carries: a frozen dataclass of numbers in metres.

    A new shape is a subclass and its line in `SHAPES`. Fields are points or numbers, or `placement`, a pose.

    Attributes:
        sizes: the keys of `obstacle_from` before the @ of `--obstacle KIND:SIZES@PLACES`, to what messages call their
            numbers, such as "R" or "SX,SY,SZ".
        places: the keys behind it, each of three numbers.
        name: what messages call it.
    """

    sizes: ClassVar[Mapping[str, str]]
    places: ClassVar[tuple[str, ...]]
    name: str

    @abstractmethod
    def solid(self) -> tuple[Array, Any]:
        """The placement in the world, shape (4, 4) [m], and coal's geometry there."""

    def solids(self) -> list[tuple[Array, Any]]:
        """Convex solids that it consists of, each as `solid` returns it."""
        return [self.solid()]

    @classmethod
    def option(cls) -> str:
        """How `--obstacle` says the shape, such as "R@X,Y,Z"."""
        return f"{','.join(cls.sizes.values())}@{';'.join('X,Y,Z' for _ in cls.places)}"

    def _check(self, points: Sequence[str] = (), lengths: Sequence[str] = ()) -> None:
        """Check the name, and keep points and positive lengths as numbers.

        Raises:
            ProblemError: one is none.
        """
        text(self.name, "name of an obstacle")
        for field in points:
            object.__setattr__(self, field, point(getattr(self, field), f"{field} of obstacle {self.name!r}"))
        for field in lengths:
            what = f"{field} of obstacle {self.name!r}"
            object.__setattr__(self, field, number(getattr(self, field), what, unit="m", sign="positive"))


@dataclass(frozen=True)
class Sphere(Obstacle):
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

    sizes, places = {"radius": "R"}, ("center",)

    def __post_init__(self) -> None:
        self._check(points=["center"], lengths=["radius"])

    def solid(self) -> tuple[Array, Any]:
        """At its centre."""
        import coal

        return homogeneous(self.center, "center"), coal.Sphere(self.radius)


@dataclass(frozen=True)
class Capsule(Obstacle):
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

    sizes, places = {"radius": "R"}, ("a", "b")

    def __post_init__(self) -> None:
        self._check(points=["a", "b"], lengths=["radius"])

    def solid(self) -> tuple[Array, Any]:
        """Along z of its placement."""
        import coal

        a, b = np.array(self.a), np.array(self.b)
        return _along((a + b) / 2, b - a), coal.Capsule(self.radius, float(np.linalg.norm(b - a)))


def _along(place: Array, z: Array) -> Array:
    """Placement with its z axis along a vector, shape (4, 4); any where the vector is 0."""
    placement = np.eye(4)
    placement[:3, 3] = place
    if np.any(z):
        placement[:3, :3] = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), z).matrix()
    return placement


@dataclass(frozen=True)
class Cylinder(Obstacle):
    """A cylinder with flat ends.

    Attributes:
        a: centre of one end, in the world [m].
        b: centre of the other end [m].
        radius: [m].
        name: what messages call it.
    """

    a: Point
    b: Point
    radius: float
    _: KW_ONLY
    name: str = "cylinder"

    sizes, places = {"radius": "R"}, ("a", "b")

    def __post_init__(self) -> None:
        self._check(points=["a", "b"], lengths=["radius"])
        if self.a == self.b:
            raise ProblemError(f"a and b of obstacle {self.name!r} are the same point; a cylinder has two ends")

    def solid(self) -> tuple[Array, Any]:
        """Along z of its placement."""
        import coal

        a, b = np.array(self.a), np.array(self.b)
        return _along((a + b) / 2, b - a), coal.Cylinder(self.radius, float(np.linalg.norm(b - a)))


@dataclass(frozen=True)
class Plane(Obstacle):
    """All points behind a plane, such as a floor or a wall: a half space.

    Attributes:
        point: of the plane, in the world [m].
        normal: points out of the obstacle, of any length.
        name: what messages call it.
    """

    point: Point
    normal: Point = (0.0, 0.0, 1.0)
    _: KW_ONLY
    name: str = "plane"

    sizes, places = {"normal": "NX,NY,NZ"}, ("point",)

    def __post_init__(self) -> None:
        self._check(points=["point", "normal"])
        if not 1e-9 < np.linalg.norm(self.normal) < np.inf:
            raise ProblemError(f"normal of obstacle {self.name!r} is {self.normal}; it must have a length")

    def solid(self) -> tuple[Array, Any]:
        """Below z of its placement."""
        import coal

        return _along(np.array(self.point), np.array(self.normal)), coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)


@dataclass(frozen=True)
class Box(Obstacle):
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

    sizes, places = {"size": "SX,SY,SZ"}, ("position",)

    def __post_init__(self) -> None:
        self._check(points=["size"])
        for edge in self.size:
            number(edge, f"an edge of obstacle {self.name!r}", unit="m", sign="positive")
        pose = homogeneous(self.placement, f"placement of obstacle {self.name!r}")
        object.__setattr__(self, "placement", tuple(map(tuple, pose.tolist())))

    @property
    def pose(self) -> Array:
        """Homogeneous matrix of its centre in the world, shape (4, 4) [m]."""
        return np.array(self.placement)

    def solid(self) -> tuple[Array, Any]:
        """At its centre."""
        import coal

        return self.pose, coal.Box(*self.size)


SHAPES: dict[str, type[Obstacle]] = {
    "sphere": Sphere,
    "capsule": Capsule,
    "cylinder": Cylinder,
    "box": Box,
    "plane": Plane,
}
"""All shapes, by the "type" that files have for them, and the word of --obstacle."""


def obstacle_from(entry: Mapping[str, Any], where: str) -> Obstacle:
    """An obstacle from what a JSON file says, such as {"type": "box", "size": […], "position": […], "rpy": […]}.

    Raises:
        ProblemError: an unknown type, or a number that is missing, superfluous or wrong.
    """
    kind = entry.get("type") if isinstance(entry, Mapping) else None
    if not isinstance(kind, str) or kind not in SHAPES:
        raise ProblemError(f'{where}: "type" is {shown(kind)}; it must be one of {", ".join(SHAPES)}')
    made: Any = SHAPES[kind]
    numbers = [field.name for field in fields(made) if field.name not in ("name", "placement")]
    placed = any(field.name == "placement" for field in fields(made))
    needed, allowed = {*numbers, *(["position"] * placed)}, {"name", *(["rpy", "quaternion"] * placed)}
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
        arguments = {key: entry[key] for key in numbers}
        if placed:
            turned = entry.get("quaternion"), entry.get("rpy")
            arguments["placement"] = pose_of(entry["position"], *turned, f"obstacle {name!r}")
        obstacle: Obstacle = made(**arguments, name=name)
    except ProblemError as error:
        raise ProblemError(f"{where}: {error}") from None
    return obstacle


def obstacle_entry(obstacle: Obstacle) -> dict[str, Any]:
    """An obstacle as `obstacle_from` takes it, and JSON says it."""
    entry: dict[str, Any] = {"type": next(kind for kind, made in SHAPES.items() if type(obstacle) is made)}
    for field in fields(obstacle):  # type: ignore[arg-type]  # it is a dataclass
        value = getattr(obstacle, field.name)
        if field.name == "placement":
            pose = np.array(value)
            entry |= pose_entry(pose, turned=not np.array_equal(pose[:3, :3], np.eye(3)))
        else:
            entry[field.name] = list(value) if isinstance(value, tuple) else value
    return entry


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
