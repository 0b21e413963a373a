"""The arm as solid bodies: its collision geometry, and one capsule around each."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

import coal
import numpy as np
import pinocchio as pin

from armdyn.arguments import shown
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.locks import built_once
from armdyn.models.reading.meshes import geometries, load_meshes, origin
from armdyn.models.reading.urdf_check import parse_urdf
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.convex_parts import convex_hull, convex_parts
from armdyn.models.scene.obstacles import Capsule

_ROUND = 24
"""Corners of the polygon around a cylinder's circle."""
ROUND_FINE = 128
"""The same of an obstacle or an attached body: 0.03 % larger, and computed once."""
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
        capsule: that contains it, in the joint's frame.
        points: in the joint's frame [m], shape (m, 3): balls around them have a convex hull that contains it.
        radius: of these balls [m].
        attached: it is the tool's or the payload's.
    """

    name: str
    joint: int
    placement: Array
    geometry: Any
    capsule: Capsule
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
            f"{robot.source} was read from no URDF, so it has no geometry: what it would touch is unknown; "
            "a URDF has geometry"
        )
    root = parse_urdf(robot.urdf, robot.source)
    for tag in ("collision", "visual"):
        found: list[Body] = []
        for name, frame, element in elements_of_links(robot, root, tag):
            try:
                at = frame.placement.homogeneous @ origin(element)
                shapes = list(_shapes(element, robot.package_dirs))
            except Exception as error:  # whatever a stranger's mesh provokes: without it nothing is known
                raise ProblemError(f"{robot.source}: link {name!r} cannot be kept clear of anything: {error}") from None
            found += [_body(name, frame, at, geometry, balls) for geometry, balls in shapes]
        if any(body.joint for body in found):
            return (*found, *_attached(robot))
    raise ProblemError(
        f"{robot.source} has no geometry, neither <collision> nor <visual>: what it would touch is unknown"
    )


def elements_of_links(robot: Robot, root: Element, tag: str) -> Iterator[tuple[str, pin.Frame, Element]]:
    """Elements "visual" or "collision" of a URDF, each with name and frame of its link, of links that the robot has."""
    for link in root.findall("link"):
        name = str(link.get("name"))
        if robot.model.existFrame(name, pin.FrameType.BODY):
            frame = robot.model.frames[robot.model.getFrameId(name, pin.FrameType.BODY)]
            yield from ((name, frame, element) for element in link.findall(tag))


def _body(name: str, frame: pin.Frame, at: Array, geometry: Any, balls: EqualBalls, attached: bool = False) -> Body:
    """A body on a frame's joint; the balls are in the geometry's own axes."""
    points, radius = balls
    moved = points @ at[:3, :3].T + at[:3, 3]
    capsule = _around(moved.tobytes(), radius)
    return Body(name, int(frame.parentJoint), at, geometry, capsule, moved, radius, attached)


def _shapes(element: Element, folders: tuple[str, ...]) -> Iterator[tuple[Any, EqualBalls]]:
    """Geometry of coal, and balls whose convex hull contains it."""
    kinds = {"box": coal.Box, "sphere": coal.Sphere, "cylinder": coal.Cylinder, "capsule": coal.Capsule}
    for tag, sizes, file in geometries(element, folders):
        if file is not None:
            corners_of = (corners for mesh, _ in load_meshes(file, sizes) for corners in convex_parts(mesh))
            yield from ((convex_hull(corners), (corners, 0.0)) for corners in corners_of)
        elif tag in kinds:
            geometry = kinds[tag](*(sizes if tag == "box" else sizes[::-1]))  # coal has the radius first
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
    if isinstance(geometry, coal.Box):
        return np.array(np.meshgrid(*([-1.0, 1.0],) * 3)).reshape(3, -1).T * np.array(geometry.halfSide), 0.0
    if isinstance(geometry, coal.Sphere):
        return np.zeros((1, 3)), float(geometry.radius)
    if isinstance(geometry, coal.Capsule):
        return np.array([[0, 0, -geometry.halfLength], [0, 0, geometry.halfLength]]), float(geometry.radius)
    if isinstance(geometry, coal.Cylinder):
        angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
        circle = geometry.radius / np.cos(np.pi / corners) * np.array([np.cos(angle), np.sin(angle)]).T
        half = geometry.halfLength
        return np.vstack([np.column_stack([circle, np.full(corners, z)]) for z in (-half, half)]), 0.0
    return np.array(geometry.points()), 0.0


@built_once(maxsize=1000)  # a link's is the same whatever the arm carries, and takes ten milliseconds
def _around(centres: bytes, thickness: float) -> Capsule:
    """The smallest capsule around balls, as found from their centres' principal axes.

    Args:
        centres: [m], floats of an array of shape (m, 3).
        thickness: radius [m].
    """
    # Loaded here, for a third of a second is much for the many problems without obstacles.
    from scipy.optimize import minimize
    from scipy.spatial import ConvexHull, QhullError

    points = np.frombuffer(centres).reshape(-1, 3)
    with suppress(QhullError, ValueError):  # flat, or too few: all of them then
        points = points[ConvexHull(points).vertices]
    centre = points.mean(axis=0)
    arms = points - centre
    size = float(np.max(np.ptp(points, axis=0)) + thickness)

    def cost(ends: Array) -> float:
        radius = float(np.max(_distances(ends, points)) + thickness)
        return float(np.pi * radius**2 * (np.linalg.norm(ends[3:] - ends[:3]) + 4 / 3 * radius))

    starts = []
    for axis in np.linalg.svd(arms, full_matrices=False)[2]:
        along = arms @ axis
        radius = float(np.max(np.linalg.norm(arms - np.outer(along, axis), axis=1)))
        low, high = along.min() + radius, along.max() - radius
        if low > high:
            low = high = (low + high) / 2
        starts.append(np.concatenate([centre + low * axis, centre + high * axis]))
    best = min(starts, key=cost)
    if len(points) > 2:
        simplex = np.vstack([best, best + 0.1 * size * np.eye(6)])
        best = minimize(cost, best, method="Nelder-Mead", options={"maxfev": 1500, "initial_simplex": simplex}).x
    a, b = (tuple(end.tolist()) for end in (best[:3], best[3:]))
    return Capsule(a, b, float(np.max(_distances(best, points)) + thickness))


def _distances(ends: Array, points: Array) -> Array:
    """Distances of points from the segment between two ends, shape (6,) together."""
    a, d = ends[:3], ends[3:] - ends[:3]
    t = np.clip((points - a) @ d / max(float(d @ d), 1e-300), 0, 1)
    return np.asarray(np.linalg.norm(points - a - t[:, None] * d, axis=1))
