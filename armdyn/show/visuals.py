"""Shapes of a robot: the visuals of its URDF, by the joints that carry them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import Element

import coal
import numpy as np
import pinocchio as pin
from meshcat import geometry as mg

from armdyn.arrays import Array
from armdyn.errors import ArmdynWarning
from armdyn.locks import built_once
from armdyn.models import Robot
from armdyn.models.reading.meshes import geometries, load_meshes, origin
from armdyn.models.reading.urdf_check import parse_urdf
from armdyn.models.scene.bodies import elements_on_frames
from armdyn.models.values.spec import BodyShape, Payload

if TYPE_CHECKING:
    import trimesh

Rgba = tuple[float, float, float, float]

_GREY = (0.62, 0.66, 0.70, 1.0)
_BONE = (0.35, 0.42, 0.50, 1.0)
_OBSTACLE = (0.93, 0.62, 0.20, 0.55)
_PLATE = (3.0, 3.0, 0.005)  # [m]: size of a drawn half space
_PAYLOAD = (0.80, 0.15, 0.18, 1.0)
_CARRIED = (0.20, 0.45, 0.72, 1.0)
_DENSITY = 2700.0  # [kg/m³], aluminium: how large a payload looks
_CREASE = np.radians(35.0)  # faces that meet at a sharper angle show an edge
_THREE_CYLINDER = pin.SE3(pin.rpy.rpyToMatrix(np.pi / 2, 0.0, 0.0), np.zeros(3)).homogeneous
"""three.js has a cylinder's axis along y, a URDF along z."""


@dataclass(frozen=True)
class VisualShape:
    """One coloured body, fixed to a joint.

    Attributes:
        joint: index in `robot.model.joints`; 0 is the world.
        placement: in the joint's frame, shape (4, 4) [m].
        geometry: meshcat's.
        rgba: each 0..1.
        name: of its link, or of the tool, the payload or the obstacle.
    """

    joint: int
    placement: Array
    geometry: Any
    rgba: Rgba
    name: str = ""


class _NormalGeometry(mg.TriangularMeshGeometry):  # type: ignore[misc]
    """A triangle mesh that brings its normals, so that edges stay sharp and curves smooth."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        super().__init__(mesh.vertices, mesh.faces)
        self.normals = np.asarray(mesh.vertex_normals, dtype=np.float32)

    def lower(self, object_data: dict[str, Any]) -> dict[str, Any]:
        lowered: dict[str, Any] = super().lower(object_data)
        lowered["data"]["attributes"]["normal"] = mg.pack_numpy_array(self.normals.T)
        return lowered


def robot_shapes(robot: Robot) -> list[VisualShape]:
    """Every visual of the robot's URDF, its payload, and plain rods where nothing else can be drawn.

    The URDF is read here and not by Pinocchio, which stops at the first mesh that it cannot find
    and would follow a mesh path out of the robot's folders.

    Warns:
        ArmdynWarning: a mesh is missing, outside the robot's folders or unreadable.
    """
    # Of a model or an MJCF nothing is known but its joints.
    root = parse_urdf(robot.urdf, robot.source) if robot.urdf else Element("robot")
    colors = {str(m.get("name")): rgba for m in root.findall("material") if (rgba := _rgba(m))}
    shapes: list[VisualShape] = []
    troubles: list[str] = []
    for name, frame, visual in elements_on_frames(robot, root, "visual"):
        material = visual.find("material")
        own = None if material is None else _rgba(material) or colors.get(str(material.get("name")))
        try:
            at = frame.placement.homogeneous @ origin(visual)
            shapes += [
                replace(shape, joint=frame.parentJoint, placement=at @ shape.placement, name=name)
                for shape in _visual_shapes(visual, robot.package_dirs, own)
            ]
        except Exception as error:  # the motion is shown also with a malformed mesh
            troubles.append(f"link {name!r}: {error}")
    if troubles:
        warnings.warn(
            f"{robot.source}: drawn without {len(troubles)} of its visuals ({'; '.join(troubles[:3])})",
            ArmdynWarning,
            stacklevel=3,
        )
    drawn = {shape.joint for shape in shapes}  # a payload alone does not show its link
    return [*shapes, *_attached(robot), *_bones(robot, drawn)]


def obstacle_shapes(
    bodies: Sequence[BodyShape], joint: int = 0, frame: Array | None = None, rgba: Rgba = _OBSTACLE
) -> list[VisualShape]:
    """Visual shapes of obstacles, fixed to the world, or of an attached body.

    Args:
        bodies: the obstacles or shapes.
        joint: that carries them; 0 is the world.
        frame: placement in the joint's frame of the frame that they are placed in, shape (4, 4) [m]; None: the joint's.
        rgba: their colour.
    """
    import trimesh

    shapes: list[VisualShape] = []
    for body in bodies:
        first = len(shapes)
        polyhedra: list[trimesh.Trimesh] = []
        for own, solid in body.solids():
            placement = own if frame is None else frame @ own
            if isinstance(solid, coal.Box):
                polyhedra.append(trimesh.creation.box(2 * solid.halfSide, placement))
            elif isinstance(solid, coal.ConvexBase):
                polyhedra.append(trimesh.convex.convex_hull(np.array(solid.points())).apply_transform(placement))
            elif isinstance(solid, coal.Halfspace):  # a plate below its plane
                at = placement @ pin.SE3(np.eye(3), np.array([0, 0, -_PLATE[2] / 2])).homogeneous
                shapes.append(VisualShape(joint, at, mg.Box(list(_PLATE)), rgba))
            else:
                shapes += _round(joint, placement, solid, rgba)
        if polyhedra:  # one geometry: a point cloud has hundreds of boxes
            whole: Any = trimesh.util.concatenate([trimesh.graph.smooth_shade(one, angle=_CREASE) for one in polyhedra])
            shapes.append(VisualShape(joint, np.eye(4), _NormalGeometry(whole), rgba))
        shapes[first:] = [replace(shape, name=body.name) for shape in shapes[first:]]
    return shapes


def _round(joint: int, placement: Array, solid: Any, rgba: Rgba) -> Iterator[VisualShape]:
    """A sphere, capsule or cylinder of coal."""
    half = 0.0 if isinstance(solid, coal.Sphere) else solid.halfLength
    a, b = (placement[:3, 3] + side * half * placement[:3, 2] for side in (-1, 1))
    if not isinstance(solid, coal.Cylinder):
        for end in [a, b] if half else [a]:
            yield VisualShape(joint, pin.SE3(np.eye(3), end).homogeneous, mg.Sphere(solid.radius), rgba)
    yield from _rod(joint, a, b, solid.radius, rgba)


def _rod(joint: int, a: Array, b: Array, radius: float, rgba: Rgba) -> Iterator[VisualShape]:
    """A cylinder between two points in a joint's frame [m]."""
    along = b - a
    length = float(np.linalg.norm(along))
    if length < 1e-6:
        return
    turned = pin.Quaternion.FromTwoVectors(np.array([0.0, 1.0, 0.0]), along).matrix()
    yield VisualShape(joint, pin.SE3(turned, (a + b) / 2).homogeneous, mg.Cylinder(length, radius), rgba)


def _rgba(material: Element) -> Rgba | None:
    color = material.find("color")
    words = [] if color is None else str(color.get("rgba", "")).split()
    try:
        r, g, b, a = (min(max(float(word), 0.0), 1.0) for word in words)
    except ValueError:
        return None
    return r, g, b, a


def _visual_shapes(visual: Element, folders: tuple[str, ...], rgba: Rgba | None) -> Iterator[VisualShape]:
    for tag, sizes, file in geometries(visual, folders):
        if file is not None:
            status = file.stat()
            for mesh, color in _load_meshes(file, tuple(sizes.tolist()), (status.st_mtime_ns, status.st_size)):
                yield VisualShape(0, np.eye(4), _NormalGeometry(mesh), rgba or color)
        elif tag == "box":
            yield VisualShape(0, np.eye(4), mg.Box(sizes.tolist()), rgba or _GREY)
        elif tag == "sphere":
            yield VisualShape(0, np.eye(4), mg.Sphere(float(sizes[0])), rgba or _GREY)
        elif tag in ("cylinder", "capsule"):
            yield VisualShape(0, _THREE_CYLINDER, mg.Cylinder(*sizes.tolist()), rgba or _GREY)


@built_once(maxsize=64)
def _load_meshes(
    path: Path, scale: tuple[float, ...], stamp: tuple[int, int]
) -> tuple[tuple[trimesh.Trimesh, Rgba], ...]:
    """The triangles of a file, one mesh per colour; stamp: when it was changed, and its size."""
    import trimesh  # slow to import, and planar arms have no meshes

    by_color: dict[Rgba, list[trimesh.Trimesh]] = {}
    for bare, mesh in load_meshes(path, np.array(scale)):
        by_color.setdefault(_mesh_color(mesh), []).append(bare)
    return tuple(
        (trimesh.graph.smooth_shade(trimesh.util.concatenate(meshes), angle=_CREASE), color)
        for color, meshes in by_color.items()
    )


def _mesh_color(mesh: trimesh.Trimesh) -> Rgba:
    visual: Any = mesh.visual
    if visual is None or not visual.defined:
        return _GREY
    material = getattr(visual, "material", None)
    color = visual.main_color if material is None else material.main_color
    r, g, b, a = (float(x) / 255.0 for x in np.asarray(color)[:4])
    return r, g, b, a or 1.0


def _attached(robot: Robot) -> Iterator[VisualShape]:
    """The shapes of tool and payload; of one without shapes a ball of its mass."""
    for body in robot.attached:
        if body.shapes or not robot.model.existFrame(body.name, pin.FrameType.BODY):
            yield from body_shapes(robot, body)


def body_shapes(robot: Robot, body: Payload) -> Iterator[VisualShape]:
    """The shapes of a tool or payload where a robot carries it; of one without shapes a ball of its mass."""
    frame, rgba = robot.frame_of(body), _GREY if body is robot.options.tool else _CARRIED
    at, joint = frame.placement.homogeneous, int(frame.parentJoint)
    yield from (replace(shape, name=body.name) for shape in obstacle_shapes(body.shapes, joint, at, rgba))
    if body.mass > 0 and not body.shapes:
        centre = pin.SE3(frame.placement.rotation, frame.placement.act(np.array(body.com))).homogeneous
        radius = max(float(np.cbrt(body.mass / _DENSITY * 3 / (4 * np.pi))), 0.016)
        yield VisualShape(joint, centre, mg.Sphere(radius), _PAYLOAD, body.name)


def _bones(robot: Robot, drawn: set[int]) -> Iterator[VisualShape]:
    """A rod from joint to joint for every joint on which nothing else is drawn."""
    model = robot.model
    tip = robot.frame(robot.tip)
    ends = [(int(model.parents[j]), model.jointPlacements[j].translation) for j in range(1, model.njoints)]
    ends.append((int(tip.parentJoint), tip.placement.translation))
    mount = robot.options.mount
    base = np.zeros(3) if mount is None else np.array(mount)[:3, 3]
    reach = sum(float(np.linalg.norm(end if joint else end - base)) for joint, end in ends)
    radius = 0.015 * reach
    for joint in set(range(1, model.njoints)) - drawn:
        yield VisualShape(joint, np.eye(4), mg.Sphere(1.4 * radius), _BONE)
    for joint, end in ends:
        if joint not in drawn:
            yield from _rod(joint, np.zeros(3) if joint else base, end, radius, _BONE)
