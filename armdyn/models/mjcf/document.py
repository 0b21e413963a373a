"""The XML of an untrusted MJCF file, with its includes."""

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from armdyn.errors import FileError, UrdfError
from armdyn.files import place_inside, read_bounded
from armdyn.models.reading.urdf_xml import MAX_BYTES, MAX_DEPTH, MAX_ELEMENTS, clipped, parse_xml, read_urdf

MAX_FILES = 100
"""An MJCF that includes more files is refused; the largest known includes some ten."""

_PASSED_OVER = ((b"<!--", b"-->"), (b"<?", b"?>"))
_ROOT = re.compile(rb"<mujoco[\s/>]")


def is_mjcf(path: str | os.PathLike[str]) -> bool:
    """Whether a file's root element is `<mujoco>`; False for a file that cannot be read."""
    try:
        data = read_bounded(path, MAX_BYTES)
    except FileError:
        return False
    at = data.find(b"<")
    while ends := [end for begin, end in _PASSED_OVER if data.startswith(begin, at)]:
        after = data.find(ends[0], at)
        at = -1 if after < 0 else data.find(b"<", after)
    return at >= 0 and _ROOT.match(data, at) is not None


def read_mjcf(file: Path) -> Element:
    """The tree of an MJCF file, each `<include>` replaced by its file.

    Raises:
        UrdfError: see `parse_mjcf`, or the file cannot be read.
    """
    return parse_mjcf(read_urdf(file), str(file), file.parent)


def parse_mjcf(text: str, source: str, folder: Path | None = None) -> Element:
    """The tree of an MJCF's text: no DTD, no entity, bounded size, includes from inside one folder only.

    Args:
        text: the MJCF.
        source: name of the file or text, in messages.
        folder: where its includes are; None: it may have none.

    Raises:
        UrdfError: not XML, no MJCF, or an include is missing, outside the folder or met twice.
    """
    root = parse_xml(text, source)
    if root.tag != "mujoco":
        hint = ": this is a URDF; use Robot.from_urdf" if root.tag == "robot" else ": this is XML but no MJCF"
        raise UrdfError(source, f"the root element is <{clipped(root.tag)}>, not <mujoco>{hint}")
    _Includes(source, folder).replace(root)
    return root


@dataclass
class _Includes:
    """Included files, each once as in MuJoCo, within bounds of number and size."""

    source: str
    folder: Path | None
    seen: set[Path] = field(default_factory=set)
    elements: int = MAX_ELEMENTS
    characters: int = MAX_BYTES

    def replace(self, element: Element, depth: int = 1) -> None:
        """Put the content of included files in the place of their `<include>`, in an element and all below it."""
        if depth > MAX_DEPTH:
            raise UrdfError(self.source, f"XML nested deeper than {MAX_DEPTH} elements")
        children = list(element)[::-1]
        element[:] = []
        while children:
            child = children.pop()
            if child.tag == "include":
                children += list(self._included(child))[::-1]
            else:
                element.append(child)
                self.replace(child, depth + 1)

    def _included(self, include: Element) -> Element:
        name = str(include.get("file", ""))
        where = f"include {clipped(name)!r}"
        if self.folder is None:
            raise UrdfError(self.source, "a text has no folder that it could include files from", where)
        try:
            file = place_inside(self.folder, name)
        except FileError as error:
            raise UrdfError(self.source, error.why, where) from None
        if file in self.seen:
            raise UrdfError(self.source, "is included twice", where)
        self.seen.add(file)
        if len(self.seen) > MAX_FILES:
            raise UrdfError(self.source, f"includes more than {MAX_FILES} files")
        try:
            text = read_urdf(file)
        except UrdfError as error:
            raise UrdfError(self.source, str(error), where) from None
        included = parse_xml(text, str(file))
        self.characters -= len(text)
        self.elements -= sum(1 for _ in included.iter())
        if self.characters < 0 or self.elements < 0:
            raise UrdfError(self.source, f"more than {MAX_BYTES} bytes or {MAX_ELEMENTS} elements, includes counted")
        return included
