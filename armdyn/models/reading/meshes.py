"""Contents of a URDF's `<visual>` and `<collision>` elements: placements, numbers, mesh files."""

import io
import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element
from xml.parsers import expat

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.errors import FileError
from armdyn.files import read_bounded
from armdyn.parsing.numbers import to_number

_MAX_MESH_BYTES = 256 * 2**20
_MESH_FORMATS = (".stl", ".dae", ".obj", ".ply", ".off", ".glb", ".gltf")  # no archives: they may hold anything


def numbers(text: str | None, n: int, default: float) -> Array:
    """An attribute of n numbers, shape (n,); one number stands for all, a missing attribute for the default.

    Raises:
        ValueError: it is something else, or not finite.
    """
    values = np.full(n, default) if text is None else np.array([to_number(word) for word in text.split()])
    if values.shape == (1,):
        values = np.repeat(values, n)
    if values.shape != (n,) or not np.all(np.isfinite(values)):
        raise ValueError(f"{text!r} is not {n} finite numbers")
    return values


def origin(element: Element) -> Array:
    """The placement of a visual or collision element in its link, shape (4, 4) [m]."""
    at = element.find("origin")
    if at is None:
        return np.eye(4)
    rpy = numbers(at.get("rpy"), 3, 0.0)
    matrix: Array = pin.SE3(pin.rpy.rpyToMatrix(rpy), numbers(at.get("xyz"), 3, 0.0)).homogeneous
    return matrix


def elements_of_links(root: Element, tag: str) -> Iterator[tuple[str, Element]]:
    """Elements "visual" or "collision" of a URDF, each with the name of its link."""
    for link in root.findall("link"):
        yield from ((str(link.get("name")), element) for element in link.findall(tag))


def geometries(
    element: Element, folders: tuple[str, ...], missing: str | None = None
) -> Iterator[tuple[str, Array, Path | None]]:
    """Shapes of a visual or collision element: tag, sizes, and of a mesh its scale and file.

    Sizes are three edges of a box [m], the radius of a sphere, a length and a radius of other shapes.

    Args:
        element: of the URDF.
        folders: see `mesh_folders`.
        missing: in place of a missing size; None: a metre.

    Raises:
        ValueError: a size is no number.
        OSError: the mesh is missing.
    """
    holder = element.find("geometry")
    for shape in () if holder is None else holder:
        if shape.tag == "mesh":
            file = resolve_mesh(str(shape.get("filename", "")), folders)
            yield shape.tag, numbers(shape.get("scale"), 3, 1.0), file
        else:
            keys = {"box": {"size": 3}, "sphere": {"radius": 1}}.get(shape.tag, {"length": 1, "radius": 1})
            sizes = [numbers(shape.get(key, missing), count, 1.0) for key, count in keys.items()]
            yield shape.tag, np.concatenate(sizes), None


def mesh_folders(urdf: Path, given: Sequence[str | os.PathLike[str]]) -> tuple[str, ...]:
    """Folders of a URDF's meshes: those given, its own, and that of its ROS package.

    Args:
        urdf: the file; a folder above it with a `package.xml` is its package.
        given: folders, each of a package or of several packages.
    """
    own = Path(os.path.realpath(urdf)).parent
    package = next((folder for folder in (own, *own.parents) if (folder / "package.xml").is_file()), None)
    return (*map(str, given), str(urdf.parent), *([] if package is None else [str(package)]))


def resolve_mesh(name: str, folders: tuple[str, ...]) -> Path:
    """The file of a URDF's mesh, which must lie inside one of the folders once links are followed.

    Args:
        name: `package://PACKAGE/…` and `model://MODEL/…` are looked for in folders that hold PACKAGE or are called
            so, `file:///…` where it says, other names below each folder.
        folders: see `mesh_folders`.

    Raises:
        FileNotFoundError: the file is missing.
        PermissionError: there is one, but not inside.
    """
    homes = [Path(os.path.realpath(folder)) for folder in folders]
    scheme, separator, rest = name.partition("://")
    inside = rest if separator and scheme in ("package", "model", "file") else name
    outside = False
    for home in homes:
        package, _, within = inside.partition("/")
        places = [home / inside, home / within] if package == home.name and separator else [home / inside]
        for place in places:
            try:
                found = Path(os.path.realpath(place))
                exists = found.is_file()
            except (OSError, ValueError):  # too long for a file's name, say
                continue
            if not any(found.is_relative_to(one) for one in homes):
                outside = True
            elif exists:
                return found
    if outside:
        raise PermissionError(f"mesh {name[:200]!r} is outside the robot's folders")
    where = "give the folder of its package: --package-dir DIR, in Python package_dirs=['DIR']"
    raise FileNotFoundError(f"no mesh {name[:200]!r}; {where}")


def load_meshes(path: Path, scale: Array, most: int = _MAX_MESH_BYTES) -> Iterator[tuple[Any, Any]]:
    """The triangle meshes of a file, scaled and placed: bare, and with their materials.

    Args:
        path: of the file.
        scale: factors along x, y and z, shape (3,).
        most: bytes that it may have.

    Raises:
        ValueError: the file is no regular one, too large, of no known format, or has no triangles.
    """
    import trimesh  # slow to import, and only for drawing and obstacles

    if path.suffix.lower() not in _MESH_FORMATS:
        raise ValueError(f"mesh {path.name!r} is none of {', '.join(_MESH_FORMATS)}")
    try:
        content = io.BytesIO(read_bounded(path, most))
        if path.suffix.lower() == ".dae":
            _refuse_dtd(content.getvalue())
    except FileError as error:
        raise ValueError(f"mesh {path.name!r}: {error.why}") from None
    except expat.ExpatError as error:
        raise ValueError(f"mesh {path.name!r}: {error}") from None
    scene = trimesh.load_scene(content, file_type=path.suffix.lower()[1:], resolver=_resolver(path))
    empty = True
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        mesh = scene.geometry[name]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            bare = trimesh.Trimesh(mesh.vertices, mesh.faces)
            bare.apply_transform(matrix)
            bare.apply_transform(np.diag([*scale, 1.0]))
            empty = False
            yield bare, mesh
    if empty:
        raise ValueError(f"mesh {path.name!r} has no triangles")


def _refuse_dtd(content: bytes) -> None:
    """Refuse a document type in XML, whose entities would be expanded.

    Raises:
        ExpatError: it has one, or is no XML.
    """

    def refuse(*_: object) -> None:
        raise expat.ExpatError("it has a DTD; no mesh needs one, and its entities are not expanded")

    parser = expat.ParserCreate()
    parser.StartDoctypeDeclHandler = refuse
    parser.Parse(content, True)


def _resolver(path: Path) -> Any:
    """Resolver for the files that a mesh refers to: those in its folder, read within the same bounds."""
    from trimesh.resolvers import FilePathResolver

    class FilesOfFolder(FilePathResolver):
        def get(self, name: str) -> bytes:
            folder = Path(os.path.realpath(self.parent))
            for place in (name.strip().lstrip("/"), Path(name).name):
                found = Path(os.path.realpath(folder / place))
                if found.is_relative_to(folder) and found.exists():
                    return read_bounded(found, _MAX_MESH_BYTES)
            raise FileNotFoundError(name)

    return FilesOfFolder(str(path))
