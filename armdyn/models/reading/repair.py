"""Faults and gaps of a URDF, with repairs: inertias, package folders, joints to lock, limits; nothing is written."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from armdyn.arguments import each, number, one_of, path_of
from armdyn.errors import ArmdynError, SpecError
from armdyn.models.reading.ends import chains, gripper_joints, joint_numbers
from armdyn.models.reading.from_pinocchio import Reading, rest_of
from armdyn.models.reading.holding import hardest_poses
from armdyn.models.reading.meshes import mesh_folders, resolve_mesh
from armdyn.models.reading.nearest_inertia import LARGE, InertiaRepair, Large, repaired_inertias, with_inertias
from armdyn.models.reading.shape_inertia import InertiaEstimate, estimated_inertias
from armdyn.models.reading.urdf_arm import massless_links, read_arm, whole_robot
from armdyn.models.reading.urdf_xml import file_path, read_urdf

_FOLDERS_ABOVE = 6
"""Folders above the file that may hold a package: a workspace is three or four above."""


@dataclass(frozen=True, kw_only=True, eq=False)
class UrdfRepair:
    """Faults and gaps of a URDF, with the least change or the option that repairs each.

    Attributes:
        source: the file.
        text: its text with physical inertias, marked as repaired; the file's own text where nothing was to be changed.
        inertias: unphysical ones, with their repairs.
        unwritten: links whose repair changes a moment by a factor of ten or more: the text has the file's inertia.
        estimates: inertias of links without mass, from their shapes and the density.
        without_mass: links that joints move, without mass even so, one per joint.
        packages: of each `package://` of its meshes the folder that has it, None where none was found.
        lock: positions at which to lock joints of a gripper, or that others mimic, by the joints' names [rad or m].
        arm: first and last joint of the longest chain where the others branch; None: they are one chain.
        tip: the arm's end, with these joints locked; empty where the URDF is refused.
        without_effort: joints without a torque limit, to the largest torque that holds them still in any
            pose [N m or N], nearly: the motor has at least that.
        without_velocity: joints without a velocity limit.
        refusal: why the URDF is refused even so; empty: it is not.
    """

    source: str
    text: str
    inertias: tuple[InertiaRepair, ...]
    unwritten: tuple[str, ...] = ()
    estimates: tuple[InertiaEstimate, ...] = ()
    without_mass: tuple[str, ...] = ()
    packages: Mapping[str, str | None]
    lock: Mapping[str, float]
    arm: tuple[str, str] | None
    tip: str = ""
    without_effort: Mapping[str, float] = field(default_factory=dict)
    without_velocity: tuple[str, ...] = ()
    refusal: str = ""


def repair_urdf(
    path: str | os.PathLike[str],
    *,
    package_dirs: Sequence[str | os.PathLike[str]] = (),
    density: float | None = None,
    large: Large = "no",
) -> UrdfRepair:
    """Find the faults and gaps of a URDF, and the least change or the option that repairs each; nothing is written.

    Packages are looked for in the given folders, in the file's own and in the six above it, by the names of the files
    that its meshes name; a link that leads out of such a folder is refused.

    Args:
        path: of the URDF.
        package_dirs: further folders of `package://` meshes.
        density: of the links without mass [kg/m³], to estimate their inertias from their collision shapes, or else
            their visuals: watertight meshes and primitives as they are, of other meshes the convex hull. None: they
            stay without.
        large: repairs that change a moment by a factor of ten or more: "no" leaves the file's inertia, "nearest" writes
            the nearest physical one, "power-of-ten" one entry times a power of ten, where that alone is physical.

    Raises:
        SpecError: package_dirs is no list of paths, density not positive, or large another word.
        UrdfError: it cannot be read, or has a fault that no number repairs, such as a joint without a parent.
    """
    file = file_path(path)
    text, source = read_urdf(file), str(file)
    root, mimics, model = whole_robot(text, source)
    one_of(large, LARGE, "large", error=SpecError)
    if density is not None:
        number(density, "density", unit="kg/m³", sign="positive", error=SpecError)
    inertias = repaired_inertias(root, source)
    chosen = {one.link: one.chosen(large) for one in inertias}
    packages = _packages(root, file, each(package_dirs, "package_dirs", path_of, error=SpecError))
    leaders = {name: mimic.leader for name, mimic in mimics.items()}
    gripper = {*gripper_joints(model, leaders), *leaders.values()} - leaders.keys()
    lock = {name: rest_of(model, i) for name, i in joint_numbers(model).items() if name in gripper}
    several = chains(model, {*lock, *mimics})
    chain = (several[0][0], several[0][-1]) if len(several) > 1 else None
    found: dict[str, Any] = {}
    try:
        text = with_inertias(text, {link: tensor for link, tensor in chosen.items() if tensor is not None})
        reading = read_arm(text, source, lock, chain)
        if density is not None:
            folders = (*mesh_folders(file, package_dirs), *filter(None, packages.values()))
            found["estimates"] = estimated_inertias(root, source, _bare(root, reading.model), folders, density)
            text = with_inertias(text, {}, found["estimates"])
            reading = read_arm(text, source, lock, chain)
        found |= _unlimited(reading) | {"without_mass": massless_links(reading.model)}
    except ArmdynError as error:
        found["refusal"] = str(error)
    unwritten = tuple(link for link, tensor in chosen.items() if tensor is None)
    found |= {"source": source, "text": text, "inertias": inertias, "unwritten": unwritten, "packages": packages}
    return UrdfRepair(**found, lock=lock, arm=chain)


def _bare(root: Element, model: pin.Model) -> set[str]:
    """Links without mass that joints move."""
    masses = {str(link.get("name")): link.find("inertial/mass") for link in root.findall("link")}
    bare = {name for name, mass in masses.items() if mass is None or not float(mass.get("value", "0"))}
    return bare & {frame.name for frame in model.frames if frame.parentJoint and frame.type == pin.FrameType.BODY}


def _unlimited(reading: Reading) -> dict[str, Any]:
    """The tip, and the joints without limits, as fields of a `UrdfRepair`."""
    model, limits = reading.model, reading.limits
    torques = [abs(torque) for _, torque in hardest_poses(model, limits.position_lower, limits.position_upper)]
    joints = list(zip(list(model.names)[1:], torques, limits.effort_upper, limits.velocity, strict=True))
    held = {name: torque for name, torque, most, _ in joints if np.isinf(most)}
    fast = tuple(name for name, *_, most in joints if np.isinf(most))
    return {"tip": reading.tip, "without_effort": held, "without_velocity": fast}


def _packages(root: Element, urdf: Path, given: Sequence[str | os.PathLike[str]]) -> dict[str, str | None]:
    """Folder of each package of the meshes, None where no folder looked in has one of them."""
    folders = mesh_folders(urdf, given)
    own = Path(os.path.realpath(urdf)).parent
    folders = (*folders, *map(str, [own, *own.parents][: _FOLDERS_ABOVE + 1]))
    found: dict[str, str | None] = {}
    for mesh in root.iter("mesh"):
        name = mesh.get("filename", "")
        package, _, inside = name.removeprefix("package://").partition("/")
        if not name.startswith("package://") or not (package and inside) or found.get(package):
            continue
        found[package] = next((folder for folder in dict.fromkeys(folders) if _has(folder, name)), None)
    return found


def _has(folder: str, mesh: str) -> bool:
    """Whether a folder has a mesh, itself inside it once links are followed."""
    try:
        return bool(resolve_mesh(mesh, (folder,)))
    except OSError:
        return False
