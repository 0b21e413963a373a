"""Untrusted XML: read in bounded time and memory, nothing in it expanded or followed."""

import os
import re
from math import isfinite
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

from armdyn.arguments import shown
from armdyn.errors import FileError, UrdfError
from armdyn.files import read_text
from armdyn.parsing.numbers import to_number

MAX_BYTES = 32 * 2**20
"""A URDF larger than this is refused [bytes]; the largest known robots stay below 1 MiB."""

MAX_DEPTH = 64
"""XML nested deeper than this is refused; a URDF needs seven levels."""

MAX_ELEMENTS = 200_000
"""XML of more elements than this is refused; the largest known robots have some five thousand."""

LARGEST = 1e9
"""Masses, moments, lengths and locked positions above are refused [SI]: no arm has them, and products overflow."""

_CONFLICT = re.compile(r"^(<{7}|\|{7}|={7}|>{7})(?: .*)?$", re.MULTILINE)
"""Lines by which git marks the two sides of a merge conflict."""

_XACRO = "is xacro that was not expanded; run `xacro` on it first and give armdyn the result"


def file_path(path: object, kind: str = "URDF", of_text: str = "Robot.from_urdf_string") -> Path:
    """Check the path of a file that describes a robot.

    Args:
        path: the argument.
        kind: of the file, in messages.
        of_text: the reader of a text of that kind.

    Raises:
        UrdfError: `path` is no path; or it is the file's text instead.
    """
    if isinstance(path, str) and "<" in path[:1000]:
        raise UrdfError("path", f"looks like {kind} text: use {of_text}")
    try:
        return Path(os.fsdecode(path))  # type: ignore[arg-type]  # it refuses other values
    except Exception:  # a foreign __fspath__ may raise anything
        raise UrdfError("path", f"is {shown(path)}; it must be the path of a {kind} file") from None


def check_text(text: object, source: object, kind: str) -> None:
    """Check that a value can be the text of a URDF or an MJCF, before it is parsed.

    Args:
        text: the argument.
        source: its name in messages.
        kind: "URDF" or "MJCF".

    Raises:
        UrdfError: no text, too long, or a path.
    """
    if not isinstance(source, str):
        raise UrdfError(
            f"{kind} text", f"source is {shown(source)}; it must be text, the name of the {kind} in messages"
        )
    if not isinstance(text, str):
        raise UrdfError(source, f"is {shown(text)}; it must be the text of {'an' if kind == 'MJCF' else 'a'} {kind}")
    if "<" not in text and text.strip().lower().endswith((".urdf", ".xml", ".xacro")):
        raise UrdfError(source, f"{shown(text)} is no {kind} text; Robot.from_{kind.lower()} takes the path of a file")
    if len(text) > MAX_BYTES:
        raise UrdfError(source, f"larger than {MAX_BYTES} bytes")


def read_urdf(path: str | os.PathLike[str]) -> str:
    """The text of a URDF file.

    Raises:
        UrdfError: missing, no regular file, unreadable, too large, or not UTF-8.
    """
    try:
        return read_text(path, MAX_BYTES)
    except FileError as error:
        raise UrdfError(str(path), error.why) from None


def parse_xml(text: str, source: str) -> ElementTree.Element:
    """The XML tree of a text: no DTD, no entity, bounded depth and number of elements, no xacro.

    Args:
        text: the XML.
        source: name of the file or text, in messages.

    Raises:
        UrdfError: one of these, not XML, or git's marker of a merge conflict in it.
    """
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate("utf-8", " ")  # the text was decoded, for any XML declaration
    depth = elements = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, elements
        depth, elements = depth + 1, elements + 1
        if depth > MAX_DEPTH:
            raise UrdfError(source, f"XML nested deeper than {MAX_DEPTH} elements")
        if elements > MAX_ELEMENTS:
            raise UrdfError(source, f"XML of more than {MAX_ELEMENTS} elements")
        namespace, _, name = tag.rpartition(" ")
        if "xacro" in namespace:
            raise UrdfError(source, f"<xacro:{clipped(name)}> {_XACRO}")
        for key, value in attributes.items():
            if "${" in value or "$(" in value:
                raise UrdfError(source, f"<{clipped(name)} {clipped(key)}={clipped(value)!r}> {_XACRO}")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: object) -> None:
        raise UrdfError(source, "has a DTD or entity declaration; no robot needs one, and they are not expanded")

    def refuse_conflict(data: str) -> None:
        if _CONFLICT.match(data):
            raise UrdfError(source, _conflict_words(data, parser.CurrentLineNumber))

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = refuse_conflict
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text.encode(), True)
    except (expat.ExpatError, UnicodeEncodeError) as error:
        if "unbound prefix" in str(error) and "<xacro:" in text:
            raise UrdfError(source, f"<xacro:…> {_XACRO}") from None
        if found := _CONFLICT.search(text):
            raise UrdfError(source, _conflict_words(found[0], text.count("\n", 0, found.start()) + 1)) from None
        raise UrdfError(source, f"not XML ({error})") from None
    return builder.close()


def _conflict_words(marker: str, line: int) -> str:
    return f"git's conflict marker {clipped(marker.strip())!r} in line {line}: keep one side of the merge alone"


def finite_numbers(
    text: str, what: str, source: str, where: str, least: int = 1, most: int | None = None, largest: float = LARGEST
) -> list[float]:
    """Numbers of an attribute, with spaces between.

    Args:
        text: the attribute's value.
        what: the quantity's name in messages.
        source: the file, in messages.
        where: the element, in messages.
        least: fewest numbers.
        most: most numbers; None: as many as the fewest.
        largest: of their magnitudes.

    Raises:
        UrdfError: another count, one is not finite, or beyond the largest.
    """
    try:
        values = [to_number(word) for word in text.split()]
    except ValueError:
        values = []
    if not least <= len(values) <= (most or least) or not all(isfinite(value) for value in values):
        count = "a finite number" if least == 1 and not most else f"{least} finite numbers"
        raise UrdfError(source, f"{what}={clipped(text)!r} is not {count}", where)
    if any(abs(value) > largest for value in values):
        raise UrdfError(source, f"{what}={clipped(text)!r} is beyond {largest:g}", where)
    return values


def clipped(text: object) -> str:
    """Text in messages: its beginning, if it is long."""
    words = str(text)
    return words if len(words) <= 80 else f"{words[:77]}..."
