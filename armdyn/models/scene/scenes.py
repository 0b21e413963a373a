"""Scenes from files: MoveIt's planning scenes, the URDF of a cell, armdyn's own lists of obstacles."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import pinocchio as pin

from armdyn.arguments import expect, number, path_of, shown
from armdyn.arrays import Array
from armdyn.errors import ArmdynError, ProblemError, did_you_mean, reraised
from armdyn.models.reading.meshes import elements_of_links, geometries, mesh_folders, origin
from armdyn.models.reading.urdf_arm import configuration
from armdyn.models.reading.urdf_check import dynamics_urdf, parse_urdf
from armdyn.models.reading.urdf_xml import read_urdf
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.mesh import Mesh, grouped
from armdyn.models.scene.moveit import read_planning_scene, read_scene_text
from armdyn.models.scene.obstacles import Obstacle, load_obstacles
from armdyn.models.scene.shapes import primitive
from armdyn.reprs import brief


@brief
@dataclass(frozen=True)
class Scene:
    """Obstacles around an arm, and the contacts that are allowed.

    Attributes:
        obstacles: in the world, each with a name of its own.
        allowed_contacts: pairs of names, of links and obstacles, that may touch.
    """

    obstacles: tuple[Obstacle, ...]
    allowed_contacts: tuple[tuple[str, str], ...] = ()


def load_scene(
    path: str | os.PathLike[str],
    robot: Robot | None = None,
    *,
    lock: Mapping[str, float] | None = None,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
) -> Scene:
    """Read a scene; docs/obstacles.md describes the kinds of files.

    The file may be untrusted: it is read up to a size, and its meshes lie inside its folder, the folder of its
    ROS package, or `package_dirs`.

    Args:
        path: of a MoveIt planning scene (.yaml, .yml, or .scene, MoveIt's text format), the URDF of a cell (.urdf), or
            a list of obstacles (.json).
        robot: objects in the frames of its links that do not move are placed in the world, and allowed contacts of
            names that neither it nor the scene has are left out. None: all objects are in the frame "world", and all
            pairs of the file are kept.
        lock: positions of joints of the cell's URDF that move [rad or m].
        package_dirs: folders of the ROS packages of the URDF's meshes.

    Raises:
        ArmdynError: the file cannot be read, or says something else; the message names the file and the object.
    """
    file = Path(path_of(path, "path of a scene"))
    kind = file.suffix.lower()
    lock = expect({} if lock is None else lock, Mapping, "lock", "a joint's name to its position")  # type: ignore[type-abstract]
    if robot is not None:
        expect(robot, Robot, "robot", "Robot.from_urdf reads one")
    if lock and kind != ".urdf":
        raise ProblemError(f"{file}: lock is for joints of a URDF; this file has none")
    if kind == ".json":
        return Scene(load_obstacles(file))
    if kind == ".urdf":
        return Scene(cell_obstacles(file, lock, package_dirs))
    if kind not in (".yaml", ".yml", ".scene"):
        raise ProblemError(
            f"{file}: a scene is a file .yaml or .scene of MoveIt, .urdf, or .json; this is none of them"
        )
    frames = {} if robot is None else _link_frames(robot)
    try:
        read = read_scene_text if kind == ".scene" else read_planning_scene
        obstacles, pairs = read(file, frames)
    except ArmdynError as error:
        message = str(error)
        raise ProblemError(message if message.startswith(str(file)) else f"{file}: {message}") from None
    if robot is not None:
        known = {*frames, *(one.name for one in obstacles)}
        pairs = tuple(pair for pair in pairs if known.issuperset(pair))
    return Scene(obstacles, pairs)


def _link_frames(robot: Robot) -> dict[str, pin.SE3 | None]:
    """Placements of a robot's links in the world, by name; None: the link moves."""
    frames = [frame for frame in robot.model.frames if frame.type == pin.FrameType.BODY]
    return {frame.name: None if frame.parentJoint else frame.placement for frame in frames}


def cell_obstacles(
    file: Path, lock: Mapping[str, float], package_dirs: Sequence[str | os.PathLike[str]]
) -> tuple[Obstacle, ...]:
    """The links of a cell's URDF that have collision geometry; if none has, those that have visuals.

    Args:
        file: the URDF.
        lock: positions of its joints that move [rad or m].
        package_dirs: folders of the ROS packages of its meshes.

    Raises:
        ArmdynError: the file is no such URDF, a joint is not locked, or a mesh is refused.
    """
    root = parse_urdf(read_urdf(file), str(file))
    placements, folders = _link_placements(root, str(file), lock), mesh_folders(file, package_dirs)
    for tag in ("collision", "visual"):
        pieces: dict[str, list[Obstacle]] = {}
        for name, element in elements_of_links(root, tag):
            with reraised(ProblemError, f"{file}: link {name!r}", ArmdynError, ValueError, OSError):
                solids = list(_solids(element, placements[name] @ origin(element), folders, name))
            pieces.setdefault(name, []).extend(solids)
        if found := tuple(grouped(own, name) for name, own in pieces.items() if own):
            return found
    raise ProblemError(f"{file}: no link has geometry, neither <collision> nor <visual>")


def _link_placements(root: Element, source: str, lock: Mapping[str, float]) -> dict[str, Array]:
    """Placements of all links in the world, shape (4, 4) [m], by name."""
    model = pin.buildModelFromXML(dynamics_urdf(root))
    moving = list(model.names)[1:]
    if unknown := [name for name in lock if name not in moving]:
        raise ProblemError(
            f"lock: no joint of {source} that moves is named {shown(unknown[0])}{did_you_mean(unknown[0], moving)}"
        )
    if free := [name for name in moving if name not in lock]:
        raise ProblemError(
            f"{source}: joint {free[0]!r} moves, and a cell stands still: make it fixed, or lock it in load_scene"
        )
    q, data = [number(lock[name], f"lock of joint {name!r}") for name in moving], model.createData()
    pin.framesForwardKinematics(model, data, configuration(model, q))
    bodies = [k for k, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
    return {model.frames[k].name: data.oMf[k].homogeneous for k in bodies}


def _solids(element: Element, pose: Array, folders: tuple[str, ...], name: str) -> Iterator[Obstacle]:
    """Obstacles of a `<collision>` or `<visual>` element, placed in the world."""
    for tag, sizes, mesh in geometries(element, folders, missing=""):
        if mesh is None:
            yield primitive(tag, sizes, pose, name)
        else:
            yield Mesh.from_file(mesh, pose, scale=sizes, name=name)
