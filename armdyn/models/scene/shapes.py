"""Obstacles of one convex solid: spheres, capsules, cylinders, boxes and half spaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any, ClassVar

import coal
import numpy as np
import pinocchio as pin

from armdyn.arguments import Checked, checked, number, shown, text
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.values.placement import Placement, Point, homogeneous, pose_rows
from armdyn.models.values.placement import point as point_of


class Obstacle(Checked):
    """Obstacle: a body fixed in the world, a frozen dataclass with lengths in metres.

    A new shape is a subclass with `solid`, or `solids` if it is not convex, and its line in `obstacles.SHAPES`. Fields
    are points or numbers, or `placement`, a pose.

    Attributes:
        sizes: the keys of `obstacle_from` before the @ of `--obstacle KIND:SIZES@PLACES`, to the names of their numbers
            in messages, such as "R" or "SX,SY,SZ".
        places: the keys behind it, each of three numbers; none: --obstacle does not say the shape.
        name: in messages.
    """

    sizes: ClassVar[Mapping[str, str]] = {}
    places: ClassVar[tuple[str, ...]] = ()
    name: str

    def solid(self) -> tuple[Array, Any]:
        """The placement in the world, shape (4, 4) [m], and coal's geometry, of a shape that is one convex solid."""
        raise NotImplementedError(f"{type(self).__name__} has neither `solid` nor `solids`")

    def solids(self) -> list[tuple[Array, Any]]:
        """Convex solids that it consists of, each as `solid` returns it."""
        return [self.solid()]

    @classmethod
    def option(cls) -> str:
        """Syntax of the shape in `--obstacle`, such as "R@X,Y,Z"."""
        return f"{','.join(cls.sizes.values())}@{';'.join('X,Y,Z' for _ in cls.places)}"

    def _of_whom(self) -> str:
        return f" of obstacle {text(self.name, 'name of an obstacle')!r}"


@dataclass(frozen=True)
class Sphere(Obstacle):
    """A ball.

    Attributes:
        center: in the world [m].
        radius: [m].
        name: in messages.
    """

    center: Point = checked(point_of)
    radius: float = checked(number, unit="m", sign="positive")
    _: KW_ONLY
    name: str = "sphere"

    sizes, places = {"radius": "R"}, ("center",)

    def solid(self) -> tuple[Array, Any]:
        """Placement at the centre, and coal's sphere."""
        return homogeneous(self.center, "center"), coal.Sphere(self.radius)


@dataclass(frozen=True)
class _Round(Obstacle):
    """A solid of revolution around a segment."""

    a: Point = checked(point_of)
    b: Point = checked(point_of)
    radius: float = checked(number, unit="m", sign="positive")
    _: KW_ONLY
    name: str = "capsule"

    sizes, places = {"radius": "R"}, ("a", "b")
    geometry: ClassVar[Any] = coal.Capsule

    def solid(self) -> tuple[Array, Any]:
        """Placement in the middle with z from a to b, and coal's geometry."""
        way = np.subtract(self.b, self.a)
        return _along(np.add(self.a, self.b) / 2, way), self.geometry(self.radius, float(np.linalg.norm(way)))


@dataclass(frozen=True)
class Capsule(_Round):
    """All points within a radius of a segment: a cylinder with round ends.

    Attributes:
        a: one end of the segment, in the world [m].
        b: its other end [m].
        radius: [m].
        name: in messages.
    """


def _along(place: Array, z: Array) -> Array:
    """Placement with its z axis along a vector, shape (4, 4); any where the vector is 0."""
    turned = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), z).matrix() if np.any(z) else np.eye(3)
    return np.array(pin.SE3(turned, place).homogeneous)


@dataclass(frozen=True)
class Cylinder(_Round):
    """A cylinder with flat ends.

    Attributes:
        a: centre of one end, in the world [m].
        b: centre of the other end [m].
        radius: [m].
        name: in messages.
    """

    _: KW_ONLY
    name: str = "cylinder"

    geometry = coal.Cylinder

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.a == self.b:
            raise ProblemError(f"a and b of obstacle {self.name!r} are the same point; a cylinder has two ends")


@dataclass(frozen=True)
class Plane(Obstacle):
    """All points behind a plane, such as a floor or a wall: a half space.

    Attributes:
        point: of the plane, in the world [m].
        normal: points out of the obstacle, of any length.
        name: in messages.
    """

    point: Point = checked(point_of)
    normal: Point = checked(point_of, (0.0, 0.0, 1.0))
    _: KW_ONLY
    name: str = "plane"

    sizes, places = {"normal": "NX,NY,NZ"}, ("point",)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1e-9 < np.linalg.norm(self.normal) < np.inf:
            raise ProblemError(f"normal of obstacle {self.name!r} is {self.normal}; it must have a length")

    def solid(self) -> tuple[Array, Any]:
        """Placement on the plane with z along its normal, and coal's half space."""
        return _along(np.array(self.point), np.array(self.normal)), coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)


@dataclass(frozen=True)
class Box(Obstacle):
    """A cuboid.

    Attributes:
        size: full edge lengths along its own axes [m].
        placement: of its centre in the world: a position [m], shape (3,), or a pose, shape (4, 4) or `pin.SE3`.
            Kept as the rows of the homogeneous matrix.
        name: in messages.
    """

    size: Point = checked(point_of)
    placement: Placement = checked(pose_rows)
    _: KW_ONLY
    name: str = "box"

    sizes, places = {"size": "SX,SY,SZ"}, ("position",)

    def __post_init__(self) -> None:
        super().__post_init__()
        for edge in self.size:
            number(edge, f"an edge of obstacle {self.name!r}", unit="m", sign="positive")

    @property
    def pose(self) -> Array:
        """Homogeneous matrix of its centre in the world, shape (4, 4) [m]."""
        return np.array(self.placement)

    def solid(self) -> tuple[Array, Any]:
        """Placement at the centre, and coal's box."""
        return self.pose, coal.Box(*self.size)


def primitive(kind: str, sizes: Array, pose: Array, name: str) -> Obstacle:
    """Shape by the convention of URDF and MoveIt: centred at a pose, with round shapes along its z axis.

    Args:
        kind: "box", "sphere", "cylinder" or "capsule".
        sizes: three edges, a radius, or a length and a radius [m].
        pose: in the world, shape (4, 4) [m].
        name: in messages.

    Raises:
        ProblemError: another kind, or malformed numbers.
    """
    count = {"box": 3, "sphere": 1, "cylinder": 2, "capsule": 2}.get(kind)
    if count is None:
        raise ProblemError(f"a shape is {shown(kind)}; it must be a box, a sphere, a cylinder, a capsule or a mesh")
    if np.shape(sizes) != (count,):
        raise ProblemError(f"a {kind} has the sizes {shown(np.ravel(sizes).tolist())}; it must have {count}")
    x, y, z = pose[:3, 3]
    if kind == "box":
        return Box(tuple(sizes.tolist()), pose, name=name)
    if kind == "sphere":
        return Sphere((x, y, z), float(sizes[0]), name=name)
    half = number(sizes[0], f"length of {kind} {name!r}", unit="m", sign="positive") / 2 * pose[:3, 2]
    round_one: type[Cylinder | Capsule] = Cylinder if kind == "cylinder" else Capsule
    a, b = (tuple((pose[:3, 3] + side * half).tolist()) for side in (-1, 1))
    return round_one(a, b, float(sizes[1]), name=name)
