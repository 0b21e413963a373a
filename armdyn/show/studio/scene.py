"""The scene of the studio's page: arm, ghosts, tip's path, obstacles, and the gizmos that move them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from meshcat import geometry as mg

from armdyn.arrays import Array
from armdyn.models.scene.obstacles import Obstacle
from armdyn.show.page.scene import is_planar, joint_poses, reach_of
from armdyn.show.studio.session import END_NAMES, End, Session
from armdyn.show.studio.state import carrying, placement_of
from armdyn.show.visuals import Rgba, VisualShape, body_shapes, obstacle_shapes, robot_shapes
from armdyn.trajectory import Trajectory

if TYPE_CHECKING:
    from viser import SceneApi


_Y_UP = pin.SE3(pin.rpy.rpyToMatrix(-np.pi / 2, 0.0, 0.0), np.zeros(3)).homogeneous
"""trimesh has a cylinder's axis along z, three.js along y."""


def joint_meshes(shapes: Iterable[VisualShape]) -> list[VisualShape]:
    """Shapes as triangles in the joint's frame: those of one joint and one colour are one."""
    groups: dict[tuple[int, Rgba], list[VisualShape]] = {}
    for shape in shapes:
        groups.setdefault((shape.joint, shape.rgba), []).append(shape)
    return [VisualShape(joint, np.eye(4), _mesh(group), rgba) for (joint, rgba), group in groups.items()]


def _mesh(group: list[VisualShape]) -> Any:
    """Meshcat's geometry of the triangles of some shapes."""
    vertices, faces, first = [], [], 0
    for shape in group:
        points, triangles = _triangles(shape.geometry)
        vertices.append(points @ shape.placement[:3, :3].T + shape.placement[:3, 3])
        faces.append(np.asarray(triangles) + first)
        first += len(points)
    return mg.TriangularMeshGeometry(np.vstack(vertices), np.vstack(faces))


def _triangles(geometry: Any) -> tuple[Array, Any]:
    """Vertices and faces of one of meshcat's geometries."""
    import trimesh

    if isinstance(geometry, mg.Box):
        solid = trimesh.creation.box(geometry.lengths)
        return solid.vertices[solid.faces.ravel()], np.arange(solid.faces.size).reshape(-1, 3)  # sharp edges
    if isinstance(geometry, mg.Sphere):
        solid = trimesh.creation.icosphere(subdivisions=3, radius=geometry.radius)
    elif isinstance(geometry, mg.Cylinder):
        solid = trimesh.creation.cylinder(geometry.radiusTop, geometry.height, sections=32)
        solid.apply_transform(_Y_UP)
        solid = trimesh.graph.smooth_shade(solid, angle=np.radians(35.0))
    else:
        return np.asarray(geometry.vertices, dtype=float), np.asarray(geometry.faces)
    return solid.vertices, solid.faces


_START, _GOAL, _PASSING, _TOUCHING = (46, 120, 210), (30, 150, 90), (120, 125, 135), (225, 40, 40)
"""Colours of the ghosts: start, goal, those between, and an end at which bodies touch."""
_END_OPACITY, _PASSING_OPACITY = 0.38, 0.12
_GHOSTS = 5
"""Ghosts between start and goal."""
_PATH_POINTS = 160
"""Of the tip's path."""
_PATH_COLOR = (232, 113, 10)


class SceneView:
    """View of a session: the handles of viser's scene."""

    def __init__(self, scene: SceneApi, session: Session):
        self._scene, self._session = scene, session
        robot = session.robot
        ends = np.array([robot.limits.position_lower, robot.limits.position_upper])
        self.reach = reach_of(robot, np.where(np.isfinite(ends), ends, 0.0))
        self.planar = is_planar(robot)
        self._frames = [scene.add_frame(f"/arm/joint{j}", show_axes=False) for j in range(1, robot.model.njoints)]
        self._ghosts: list[tuple[VisualShape, Any]] = []
        for k, mesh in enumerate(joint_meshes(robot_shapes(carrying(robot, 0.0)))):
            self._add_mesh(f"{_parent(mesh)}/shape{k}", mesh)
            if mesh.joint:
                self._ghosts.append((mesh, self._add_ghosts(f"/ghosts/{k}", mesh)))
        self.gizmos = {end: self._add_gizmo(f"/{end}", 0.16 * self.reach, robot.nv < 6) for end in END_NAMES}
        self.mover = scene.add_transform_controls(
            "/mover", scale=0.2 * self.reach, depth_test=False, visible=False, opacity=0.9
        )
        size = float(np.ceil(2 * self.reach))
        scene.add_grid(
            "/floor",
            width=size,
            height=size,
            cell_size=0.1,
            section_size=0.5,
            cell_color=(228, 231, 236),
            section_color=(196, 202, 212),
            position=(0, 0, -1e-3),
        )
        self._carried: list[str] = []
        self._obstacles: dict[Obstacle, tuple[str, int]] = {}
        self._made = 0
        self._path: Any = None

    def show_ends(self, motion: Trajectory | None) -> None:
        """Draw the ghosts of start and goal, red where something touches, those between, and the gizmos there.

        Args:
            motion: that the ghosts between are of; None: there are none.
        """
        session = self._session
        ends = [np.array(session.state.start), np.array(session.state.goal)]
        between = [motion(t).q for t in np.linspace(motion.t[0], motion.t[-1], _GHOSTS + 2)[1:-1]] if motion else []
        poses, _ = joint_poses(session.robot, np.array([*ends, *between]))
        extra = _GHOSTS - len(between)
        poses = np.concatenate([poses, np.repeat(poses[:1], extra, axis=0)])
        opacities = np.array([_END_OPACITY, _END_OPACITY] + [_PASSING_OPACITY] * len(between) + [0.0] * extra)
        start, goal = (
            _TOUCHING if end in session.touching else color
            for end, color in zip(END_NAMES, (_START, _GOAL), strict=True)
        )
        colors = np.array([start, goal] + [_PASSING] * _GHOSTS, dtype=np.uint8)
        for mesh, handle in self._ghosts:
            handle.batched_positions = poses[:, mesh.joint - 1, :3].astype(np.float32)
            handle.batched_wxyzs = _wxyz(poses[:, mesh.joint - 1, 3:]).astype(np.float32)
            handle.batched_colors = colors
            handle.batched_opacities = opacities.astype(np.float32)

    def place_gizmo(self, end: End) -> None:
        """Put the gizmo of an end where the arm's tip is."""
        _place(self.gizmos[end], self._session.pose_of(end))

    def show_arm(self, q: Array) -> None:
        """Move the solid arm to joint positions [rad or m], shape (nv,)."""
        poses, _ = joint_poses(self._session.robot, q[None])
        for frame, pose in zip(self._frames, poses[0], strict=True):
            frame.position, frame.wxyz = pose[:3], _wxyz(pose[3:])

    def show_path(self, motion: Trajectory | None) -> None:
        """Draw the path of the tip along a motion; None: none."""
        if self._path is not None:
            self._path.remove()
            self._path = None
        if motion is None:
            return
        _, tips = joint_poses(self._session.robot, motion(np.linspace(motion.t[0], motion.t[-1], _PATH_POINTS)).q)
        segments = np.stack([tips[:-1], tips[1:]], axis=1).astype(np.float32)
        self._path = self._scene.add_line_segments("/path", segments, _PATH_COLOR, thickness=0.006 * self.reach)

    def show_payload(self) -> None:
        """Draw the payload at the solid arm."""
        for name in self._carried:
            self._scene.remove_by_name(name)
        robot = self._session.robot
        meshes = [] if robot.payload is None else joint_meshes(body_shapes(robot, robot.payload))
        self._carried = [f"{_parent(mesh)}/payload{k}" for k, mesh in enumerate(meshes)]
        for name, mesh in zip(self._carried, meshes, strict=True):
            self._add_mesh(name, mesh)

    def show_obstacles(self) -> None:
        """Draw the obstacles that are new, and take away those that are no more."""
        now = self._session.state.obstacles
        for gone in self._obstacles.keys() - set(now):
            name, count = self._obstacles.pop(gone)
            for k in range(count):
                self._scene.remove_by_name(f"{name}/{k}")
        for one in now:
            if one not in self._obstacles:
                self._made += 1
                name, meshes = f"/obstacles/{self._made}", joint_meshes(obstacle_shapes([one]))
                for k, mesh in enumerate(meshes):
                    self._add_mesh(f"{name}/{k}", mesh)
                self._obstacles[one] = name, len(meshes)

    def show_mover(self, obstacle: Obstacle | None) -> None:
        """Put the gizmo that moves obstacles at one; None: hide it."""
        at = None if obstacle is None else placement_of(obstacle)
        self.mover.visible = at is not None
        if at is not None:
            _place(self.mover, at)

    def _add_mesh(self, name: str, mesh: VisualShape) -> None:
        r, g, b, a = mesh.rgba
        color, opacity = (round(255 * r), round(255 * g), round(255 * b)), a if a < 1 else None
        side: Any = "double" if opacity is None else "front"
        self._scene.add_mesh_simple(
            name, mesh.geometry.vertices, mesh.geometry.faces, color=color, opacity=opacity, side=side
        )

    def _add_ghosts(self, name: str, mesh: VisualShape) -> Any:
        count = 2 + _GHOSTS
        return self._scene.add_batched_meshes_simple(
            name, mesh.geometry.vertices, mesh.geometry.faces,
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), batched_positions=np.zeros((count, 3)),
            batched_colors=np.tile(np.array(_PASSING, dtype=np.uint8), (count, 1)), batched_opacities=np.zeros(count),
            opacity=1.0, lod="off", cast_shadow=False, receive_shadow=False,
        )  # fmt: skip

    def _add_gizmo(self, name: str, scale: float, position_only: bool) -> Any:
        """A gizmo at an end: of an arm of fewer than six joints it only shifts, of a planar one in its plane."""
        axes = (True, not self.planar, True)
        return self._scene.add_transform_controls(
            name, scale=scale, active_axes=axes, disable_rotations=position_only, depth_test=False, opacity=0.9
        )


def _parent(mesh: VisualShape) -> str:
    return f"/arm/joint{mesh.joint}" if mesh.joint else "/arm"


def _place(handle: Any, at: pin.SE3) -> None:
    handle.position, handle.wxyz = at.translation, _wxyz(pin.SE3ToXYZQUAT(at)[3:])


def _wxyz(xyzw: Array) -> Array:
    """Quaternions with the real part first, shape (…, 4)."""
    return np.roll(xyzw, 1, axis=-1)
