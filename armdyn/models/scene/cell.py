"""The URDF of a cell as obstacles: one for each link, of its collision geometry."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from armdyn.arguments import number, shown
from armdyn.arrays import Array
from armdyn.errors import ArmdynError, ProblemError, did_you_mean
from armdyn.models.reading.meshes import geometries, mesh_folders, origin
from armdyn.models.reading.urdf_check import dynamics_urdf, parse_urdf
from armdyn.models.reading.urdf_xml import read_urdf
from armdyn.models.scene.mesh import Mesh, grouped
from armdyn.models.scene.shapes import Obstacle, primitive


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
        found: list[Obstacle] = []
        for link in root.findall("link"):
            name = str(link.get("name"))
            pieces: list[Obstacle] = []
            for element in link.findall(tag):
                try:
                    pieces += _solids(element, placements[name] @ origin(element), folders, name)
                except (ArmdynError, ValueError, OSError) as error:
                    raise ProblemError(f"{file}: link {name!r}: {error}") from None
            found += [grouped(pieces, name)] if pieces else []
        if found:
            return tuple(found)
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
    q = pin.neutral(model)
    for name, position in lock.items():
        joint, at = model.joints[model.getJointId(name)], number(position, f"lock of joint {name!r}")
        q[joint.idx_q : joint.idx_q + joint.nq] = at if joint.nq == 1 else (np.cos(at), np.sin(at))
    data = model.createData()
    pin.framesForwardKinematics(model, data, q)
    bodies = [k for k, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY]
    return {model.frames[k].name: data.oMf[k].homogeneous for k in bodies}


def _solids(element: Element, pose: Array, folders: tuple[str, ...], name: str) -> Iterator[Obstacle]:
    """Obstacles of a `<collision>` or `<visual>` element, placed in the world."""
    for tag, sizes, mesh in geometries(element, folders, missing=""):
        if mesh is None:
            yield primitive(tag, sizes, pose, name)
        else:
            yield Mesh.from_file(mesh, pose, scale=sizes, name=name)
