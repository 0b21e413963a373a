"""The arm as solid bodies: its collision geometry, and one capsule around each."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from armdyn.errors import ProblemError
from armdyn.locks import built_once
from armdyn.models.reading.meshes import load_meshes, numbers, origin, resolve_mesh
from armdyn.models.reading.urdf_check import parse_urdf
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.convex_parts import convex_hull, convex_parts
from armdyn.models.scene.obstacles import Capsule

Array = NDArray[np.float64]

_ROUND = 24
"""Corners of the polygon around a cylinder's circle."""
_ONE = 2.0
"""A link's parts share a capsule if it has no more than this times the volume of their own."""


@dataclass(frozen=True, eq=False)
class Body:
    """A solid that moves with a joint.

    Attributes:
        name: of its link.
        joint: index in `robot.model.joints`; 0 is the world.
        placement: of the geometry in the joint's frame, shape (4, 4) [m].
        geometry: coal's.
        capsule: that contains it, in the joint's frame.
        points: in the joint's frame [m], shape (m, 3): balls around them have a convex hull that contains it.
        radius: of these balls [m].
    """

    name: str
    joint: int
    placement: Array
    geometry: Any
    capsule: Capsule
    points: Array
    radius: float


@built_once(maxsize=16)
def bodies(robot: Robot) -> tuple[Body, ...]:
    """What a robot can touch with: its URDF's collision geometry; if it has none, what is drawn of it.

    Raises:
        ProblemError: a mesh is missing or unreadable, there is no geometry at all, or it was read from no URDF.
    """
    if not robot.urdf:
        raise ProblemError(
            f"{robot.source} was read from no URDF, so it has no geometry: what it would touch is unknown; "
            "Robot.from_urdf reads an arm with its geometry"
        )
    root = parse_urdf(robot.urdf, robot.source)
    for tag in ("collision", "visual"):
        found: list[Body] = []
        for link in root.findall("link"):
            name = str(link.get("name"))
            if not robot.model.existFrame(name, pin.FrameType.BODY):
                continue
            frame = robot.model.frames[robot.model.getFrameId(name, pin.FrameType.BODY)]
            for element in link.findall(tag):
                try:
                    at = frame.placement.homogeneous @ origin(element)
                    shapes = list(_shapes(element, robot.package_dirs))
                except Exception as error:  # whatever a stranger's mesh provokes: without it nothing is known
                    raise ProblemError(
                        f"{robot.source}: link {name!r} cannot be kept clear of anything: {error}"
                    ) from None
                for geometry, points, thickness in shapes:
                    moved = points @ at[:3, :3].T + at[:3, 3]
                    capsule = _around(moved, thickness)
                    found.append(Body(name, int(frame.parentJoint), at, geometry, capsule, moved, thickness))
        if any(body.joint for body in found):
            return tuple(found)
    raise ProblemError(
        f"{robot.source} has no geometry, neither <collision> nor <visual>: what it would touch is unknown"
    )


def _shapes(element: Element, folders: tuple[str, ...]) -> Iterator[tuple[Any, Array, float]]:
    """Geometry of coal, and points and a thickness around them whose convex hull contains it."""
    import coal

    holder = element.find("geometry")
    for shape in () if holder is None else holder:
        if shape.tag == "box":
            size = numbers(shape.get("size"), 3, 1.0)
            corners = np.array(np.meshgrid(*([-0.5, 0.5],) * 3)).reshape(3, -1).T
            yield coal.Box(*size), corners * size, 0.0
        elif shape.tag == "sphere":
            radius = float(numbers(shape.get("radius"), 1, 1.0)[0])
            yield coal.Sphere(radius), np.zeros((1, 3)), radius
        elif shape.tag in ("cylinder", "capsule"):
            length, radius = (float(numbers(shape.get(key), 1, 1.0)[0]) for key in ("length", "radius"))
            ends = np.array([[0, 0, -length / 2], [0, 0, length / 2]])
            if shape.tag == "capsule":
                yield coal.Capsule(radius, length), ends, radius
                continue
            yield coal.Cylinder(radius, length), around_cylinder(radius, length / 2, _ROUND), 0.0
        elif shape.tag == "mesh":
            path = resolve_mesh(str(shape.get("filename", "")), folders)
            for mesh, _ in load_meshes(path, numbers(shape.get("scale"), 3, 1.0)):
                for corners in convex_parts(mesh):
                    yield convex_hull(corners), corners, 0.0


def around_cylinder(radius: float, half_length: float, corners: int) -> Array:
    """Corners of a prism that contains a cylinder along z around the origin [m], shape (2 * corners, 3)."""
    angle = np.linspace(0, 2 * np.pi, corners, endpoint=False)
    circle = radius / np.cos(np.pi / corners) * np.array([np.cos(angle), np.sin(angle)]).T
    ends = (np.column_stack([circle, np.full(corners, z)]) for z in (-half_length, half_length))
    return np.vstack(list(ends))


def capsules(robot: Robot) -> tuple[tuple[str, int, Capsule], ...]:
    """Few capsules that contain the robot: link, joint's index, and capsule in the joint's frame.

    Raises:
        ProblemError: see `bodies`.
    """
    links: dict[tuple[str, int], list[Capsule]] = {}
    for body in bodies(robot):
        links.setdefault((body.name, body.joint), []).append(body.capsule)
    out: list[tuple[str, int, Capsule]] = []
    for (name, joint), parts in links.items():
        one = _around_capsules(parts) if len(parts) > 1 else parts[0]
        whole = [one] if volume(one) <= _ONE * sum(map(volume, parts)) else parts
        out += [(name, joint, part) for part in whole]
    return tuple(out)


def volume(capsule: Capsule) -> float:
    """Of a capsule [m³]."""
    length = float(np.linalg.norm(np.subtract(capsule.b, capsule.a)))
    return float(np.pi * capsule.radius**2 * (length + 4 / 3 * capsule.radius))


def _around_capsules(parts: Sequence[Capsule]) -> Capsule:
    """One around several: a ball lies in a capsule if its centre lies in that with so much less radius."""
    points = np.array([end for part in parts for end in (part.a, part.b)])
    return _around(points, np.repeat([part.radius for part in parts], 2))


def _around(points: Array, thickness: ArrayLike) -> Capsule:
    """The smallest capsule around balls, as found from their centres' principal axes.

    Args:
        points: centres [m], shape (m, 3).
        thickness: radii [m], one or shape (m,).
    """
    # Loaded here, for a third of a second is much for the many problems without obstacles.
    from scipy.optimize import minimize
    from scipy.spatial import ConvexHull, QhullError

    radii = np.broadcast_to(np.asarray(thickness, dtype=float), len(points))
    if not np.ptp(radii):
        with suppress(QhullError, ValueError):  # flat, or too few: all of them then
            points = points[ConvexHull(points).vertices]
        radii = radii[: len(points)]
    centre = points.mean(axis=0)
    arms = points - centre
    size = float(np.max(np.ptp(points, axis=0)) + np.max(radii))

    def cost(ends: Array) -> float:
        radius = float(np.max(_distances(ends, points) + radii))
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
    return Capsule(a, b, float(np.max(_distances(best, points) + radii)))


def _distances(ends: Array, points: Array) -> Array:
    """Of points from the segment between two ends, shape (6,) together."""
    a, d = ends[:3], ends[3:] - ends[:3]
    t = np.clip((points - a) @ d / max(float(d @ d), 1e-300), 0, 1)
    return np.asarray(np.linalg.norm(points - a - t[:, None] * d, axis=1))
