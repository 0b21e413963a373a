"""Inertias of links without mass, estimated from their shapes and a density."""

from collections.abc import Set
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.errors import ProblemError, reraised
from armdyn.models.reading.meshes import geometries, load_meshes, origin


@dataclass(frozen=True, kw_only=True, eq=False)
class InertiaEstimate:
    """Inertia of a link as a solid of even density.

    Attributes:
        link: name of the link.
        shapes: its shapes, such as "collision: mesh, watertight" or "visual: mesh, convex hull".
        inertia: mass, centre of mass and inertia in the link's frame.
    """

    link: str
    shapes: str
    inertia: pin.Inertia

    @property
    def mass(self) -> float:
        """Mass [kg]."""
        return float(self.inertia.mass)

    @property
    def com(self) -> Array:
        """Centre of mass in the link's frame [m], shape (3,)."""
        return np.array(self.inertia.lever)

    @property
    def moments(self) -> Array:
        """Principal moments [kg m²], ascending, shape (3,)."""
        return np.asarray(np.linalg.eigvalsh(self.inertia.inertia))


def estimated_inertias(
    root: Element, source: str, links: Set[str], folders: tuple[str, ...], density: float
) -> tuple[InertiaEstimate, ...]:
    """Inertias of links from their collision shapes, else from their visuals; a link without shapes is left out.

    Args:
        root: of `urdf_check.parse_urdf`.
        source: name of the file, in messages.
        links: names of links.
        folders: see `meshes.mesh_folders`.
        density: [kg/m³].

    Raises:
        ProblemError: a mesh is missing or unreadable.
    """
    found = []
    for link in (one for one in root.findall("link") if one.get("name") in links):
        for tag in ("collision", "visual"):
            with reraised(ProblemError, f"{source}: link {link.get('name')!r}", Exception):  # of a foreign mesh
                solids = [one for element in link.findall(tag) for one in _solids(element, folders, density)]
            if solids:
                whole = sum((one for one, _ in solids[1:]), solids[0][0])
                shapes = f"{tag}: {', '.join(dict.fromkeys(name for _, name in solids))}"
                found.append(InertiaEstimate(link=str(link.get("name")), shapes=shapes, inertia=whole))
                break
    return tuple(found)


def _solids(element: Element, folders: tuple[str, ...], density: float) -> list[tuple[pin.Inertia, str]]:
    """Inertias of the shapes of a visual or collision element in the link's frame, and what each was computed from."""
    found, place = [], pin.SE3(origin(element))
    for tag, sizes, file in geometries(element, folders, missing=""):
        for mesh, _ in [] if file is None else load_meshes(file, sizes):
            mesh.merge_vertices()
            whole = mesh.is_watertight and mesh.volume > 0
            solid = mesh if whole else mesh.convex_hull
            own = pin.Inertia(density * solid.volume, solid.center_mass, density * solid.moment_inertia)
            found.append((own, "mesh, watertight" if whole else "mesh, convex hull"))
        if file is None:
            length, radius = sizes[0], sizes[-1]
            ball, rod = 4 / 3 * np.pi * radius**3, np.pi * radius**2 * length
            volume = {"box": np.prod(sizes), "sphere": ball, "cylinder": rod, "capsule": rod + ball}[tag]
            of_shape = getattr(pin.Inertia, f"From{tag.capitalize()}")
            found.append(
                (of_shape(density * volume, *(sizes if tag == "box" else sizes[::-1])), tag)
            )  # the radius first
    return [(place.act(own), name) for own, name in found]
