"""The arm as solid bodies: its collision geometry, and a few balls that contain each."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

import coal
import numpy as np
import pinocchio as pin

from armdyn.arguments import shown
from armdyn.arrays import Array
from armdyn.errors import ProblemError, reraised
from armdyn.locks import built_once
from armdyn.models.reading.meshes import elements_of_links, geometries, load_meshes, origin
from armdyn.models.reading.urdf_check import parse_urdf
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.convex_parts import convex_hull, convex_parts

_ROUND = 24
"""Corners of the polygon around a cylinder's circle."""
ROUND_FINE = 128
"""The same of an obstacle or an attached body: 0.03 % larger, and computed once."""
BALLS = 3
"""Balls that contain a body: with three a Panda's far pairs are distinguished from its near ones."""
EqualBalls = tuple[Array, float]
"""Centres [m], shape (m, 3), and radius [m]."""


@dataclass(frozen=True, eq=False)
class Body:
    """A solid that moves with a joint.

    Attributes:
        name: of its link, or of the tool or the payload.
        joint: index in `robot.model.joints`; 0 is the world.
        placement: of the geometry in the joint's frame, shape (4, 4) [m].
        geometry: coal's.
        balls: that contain it, in the joint's frame.
        points: in the joint's frame [m], shape (m, 3): balls around them have a convex hull that contains it.
        radius: of the balls around these points [m].
        attached: it is the tool's or the payload's.
    """

    name: str
    joint: int
    placement: Array
    geometry: Any
    balls: EqualBalls
    points: Array
    radius: float
    attached: bool = False


@built_once(maxsize=16)
def bodies(robot: Robot) -> tuple[Body, ...]:
    """Solids of a robot: its URDF's collision geometry, or else its visuals; then its tool and its payload.

    Raises:
        ProblemError: a mesh is missing or unreadable, there is no geometry at all, or it was read from no URDF.
    """
    if not robot.urdf:
        raise ProblemError(
            f"{robot.source} was read from no URDF, so it has no geometry, and contacts are unknown; "
            "a URDF has geometry"
        )
    root = parse_urdf(robot.urdf, robot.source)
    for tag in ("collision", "visual"):
        found: list[Body] = []
        for name, frame, element in elements_on_frames(robot, root, tag):
            where = f"{robot.source}: link {name!r} cannot be kept clear of anything"
            # Any error of a foreign mesh: without it contacts are unknown.
            with reraised(ProblemError, where, Exception):
                at = frame.placement.homogeneous @ origin(element)
                shapes = list(_shapes(element, robot.package_dirs))
            found += [_body(name, frame, at, geometry, balls) for geometry, balls in shapes]
        if any(body.joint for body in found):
            return (*found, *_attached(robot))
    raise ProblemError(f"{robot.source} has no geometry, neither <collision> nor <visual>: contacts are unknown")


def elements_on_frames(robot: Robot, root: Element, tag: str) -> Iterator[tuple[str, pin.Frame, Element]]:
    """Elements "visual" or "collision" of a URDF, each with name and frame of its link, of links that the robot has."""
    for name, element in elements_of_links(root, tag):
        if robot.model.existFrame(name, pin.FrameType.BODY):
            yield name, robot.model.frames[robot.model.getFrameId(name, pin.FrameType.BODY)], element


_SIZES: dict[str, tuple[Any, tuple[str, ...]]] = {
    "box": (coal.Box, ("halfSide",)),
    "sphere": (coal.Sphere, ("radius",)),
    "capsule": (coal.Capsule, ("radius", "halfLength")),
    "cylinder": (coal.Cylinder, ("radius", "halfLength")),
    "half space": (coal.Halfspace, ("n", "d")),
}
"""Classes of coal and their sizes, by the names that URDF, MuJoCo and `_collision/` have for them."""


def sizes_of(geometry: Any) -> tuple[str, Array]:
    """Kind of a convex solid of coal, and its half edges, or radius and half length [m], or normal and offset [m].

    Of any other solid the kind is "convex", and its corners, shape (m, 3), are the sizes.
    """
    for kind, (made, names) in _SIZES.items():
        if isinstance(geometry, made):
            return kind, np.hstack([getattr(geometry, name) for name in names])
    return "convex", np.array(geometry.points())


def _body(name: str, frame: pin.Frame, at: Array, geometry: Any, balls: EqualBalls, attached: bool = False) -> Body:
    """A body on a frame's joint; the balls are in the geometry's own axes."""
    points, radius = balls
    moved = points @ at[:3, :3].T + at[:3, 3]
    return Body(name, int(frame.parentJoint), at, geometry, _in_a_row(moved, radius), moved, radius, attached)


def _shapes(element: Element, folders: tuple[str, ...]) -> Iterator[tuple[Any, EqualBalls]]:
    """Geometry of coal, and balls whose convex hull contains it."""
    for tag, sizes, file in geometries(element, folders):
        if file is not None:
            corners_of = (corners for mesh, _ in load_meshes(file, sizes) for corners in convex_parts(mesh))
            yield from ((convex_hull(corners), (corners, 0.0)) for corners in corners_of)
        elif tag in _SIZES:
            geometry = _SIZES[tag][0](*(sizes if tag == "box" else sizes[::-1]))  # coal has the radius first
            yield geometry, balls_around(geometry, _ROUND)


def _attached(robot: Robot) -> Iterator[Body]:
    """Solids of the tool and the payload.

    Raises:
        ProblemError: a shape has no end.
    """
    for body in robot.attached:
        frame = robot.frame_of(body)
        for shape in body.shapes:
            for placement, geometry in shape.solids():
                if isinstance(geometry, coal.Halfspace) or not isinstance(geometry, coal.ShapeBase):
                    raise ProblemError(f"{body.name}: {shown(shape)} is no solid that an arm could carry")
                at = frame.placement.homogeneous @ placement
                yield _body(body.name, frame, at, geometry, balls_around(geometry, ROUND_FINE), attached=True)


def balls_around(geometry: Any, corners: int) -> EqualBalls:
    """Balls whose convex hull contains a geometry of coal.

    Args:
        geometry: a convex solid.
        corners: of the polygon around a cylinder's circle.
    """
    kind, sizes = sizes_of(geometry)
    if kind == "box":
        return np.array(np.meshgrid(*([-1.0, 1.0],) * 3)).reshape(3, -1).T * sizes, 0.0
    if kind in ("convex", "sphere"):
        return (sizes, 0.0) if kind == "convex" else (np.zeros((1, 3)), float(sizes[0]))
    radius, half = sizes.tolist()
    if kind == "capsule":
        return np.array([[0, 0, -half], [0, 0, half]]), radius
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    circle = radius / np.cos(np.pi / corners) * np.array([np.cos(angle), np.sin(angle)]).T
    return np.vstack([np.column_stack([circle, np.full(corners, z)]) for z in (-half, half)]), 0.0


def _in_a_row(points: Array, radius: float) -> EqualBalls:
    """Balls that contain the convex hull of equal balls: along the axis of a capsule that does, a principal axis.

    Args:
        points: centres of the balls [m], shape (m, 3).
        radius: of them [m].
    """
    mean = points.mean(axis=0)
    axes = np.linalg.eigh((points - mean).T @ (points - mean))[1].T
    along = (points - mean) @ axes.T
    middle, half = (along.max(axis=0) + along.min(axis=0)) / 2, np.ptp(along, axis=0) / 2
    found: list[tuple[float, int, float]] = []
    for k, away in enumerate(np.abs(along - middle).T):
        squares = np.sum((along - middle) ** 2, axis=1) - away**2
        length = max(float(half[k] - np.sqrt(np.max(squares))), 0.0)  # half the capsule's axis
        thick = float(np.sqrt(np.max(squares + np.maximum(away - length, 0.0) ** 2)))
        found.append((thick + length / BALLS, k, length))
    size, k, length = min(found)
    parts = ((2 * np.arange(BALLS) + 1) / BALLS - 1)[:, None] * length * axes[k]
    return mean + middle @ axes + parts, size + radius
