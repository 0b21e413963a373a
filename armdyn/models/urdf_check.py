"""What a URDF from a stranger must pass before Pinocchio reads it."""

import os
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.parsers import expat

import numpy as np

from armdyn.errors import UnsupportedJointError, UrdfError

MAX_BYTES = 32 * 2**20
"""A URDF larger than this is refused [bytes]; the largest known robots stay below 1 MiB."""

MAX_DEPTH = 64
"""XML nested deeper than this is refused; a URDF needs seven levels."""

MOVING = ("revolute", "continuous", "prismatic")
_TRIANGLE_TOLERANCE = 1e-2  # published URDFs round principal moments to two or three digits


def read_urdf(path: str | os.PathLike[str]) -> str:
    """The text of a URDF file.

    Raises:
        UrdfError: missing, unreadable, too large, or not UTF-8.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise UrdfError(str(path), "no such file") from None
    except (OSError, ValueError) as error:
        raise UrdfError(str(path), f"cannot be read ({error})") from None
    if len(data) > MAX_BYTES:
        raise UrdfError(str(path), f"larger than {MAX_BYTES} bytes")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise UrdfError(str(path), f"not UTF-8 (byte {error.start})") from None


def parse_urdf(text: str, source: str) -> ElementTree.Element:
    """The checked XML tree of a URDF: no DTD, no entity, bounded depth, physical numbers.

    Args:
        text: the URDF.
        source: what to call it in messages.

    Raises:
        UrdfError: not XML, no URDF, or a link or joint is not physical; says which and what would be right.
        UnsupportedJointError: a joint is neither revolute, continuous, prismatic nor fixed.
    """
    root = _parse_xml(text, source)
    if root.tag != "robot":
        raise UrdfError(source, f"the root element is <{root.tag}>, not <robot>: this is XML but no URDF")
    links = _named(root, "link", source)
    joints = _named(root, "joint", source)
    if not links:
        raise UrdfError(source, "has no <link>")
    for name, link in links.items():
        _check_link(link, source, f"link {name!r}")
    for name, joint in joints.items():
        _check_joint(joint, source, f"joint {name!r}", links)
    _check_tree(links, joints, source)
    return root


def _parse_xml(text: str, source: str) -> ElementTree.Element:
    builder = ElementTree.TreeBuilder()
    parser = expat.ParserCreate("utf-8", " ")  # the text was decoded: whatever its XML declaration says
    depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise UrdfError(source, f"XML nested deeper than {MAX_DEPTH} elements")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: object) -> None:
        raise UrdfError(source, "has a DTD or entity declaration; a URDF needs none, and they are not expanded")

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text.encode(), True)
    except (expat.ExpatError, UnicodeEncodeError) as error:
        raise UrdfError(source, f"not XML ({error})") from None
    return builder.close()


def _named(root: ElementTree.Element, tag: str, source: str) -> dict[str, ElementTree.Element]:
    found: dict[str, ElementTree.Element] = {}
    for element in root.findall(tag):
        name = element.get("name")
        if not name:
            raise UrdfError(source, f"a <{tag}> has no name")
        if name in found:
            raise UrdfError(source, "is defined twice", f"{tag} {name!r}")
        found[name] = element
    return found


def _numbers(element: ElementTree.Element | None, keys: tuple[str, ...], source: str, where: str) -> list[float]:
    """Attributes as finite numbers; a missing element is an error, a missing attribute too."""
    if element is None:
        raise UrdfError(source, f"lacks the element with {', '.join(keys)}", where)
    values = []
    for key in keys:
        text = element.get(key)
        if text is None:
            raise UrdfError(source, f"<{element.tag}> lacks {key}", where)
        try:
            value = float(text)
        except ValueError:
            raise UrdfError(source, f"<{element.tag}> {key}={text!r} is not a number", where) from None
        if not np.isfinite(value):
            raise UrdfError(source, f"<{element.tag}> {key}={text!r} is not finite", where)
        values.append(value)
    return values


def _vectors(element: ElementTree.Element, source: str, where: str) -> Iterator[tuple[str, np.ndarray]]:
    for key in ("xyz", "rpy"):
        text = element.get(key)
        if text is None:
            continue
        try:
            vector = np.array([float(word) for word in text.split()])
        except ValueError:
            vector = np.array([])
        if vector.size != 3 or not np.all(np.isfinite(vector)):
            raise UrdfError(source, f"<{element.tag}> {key}={text!r} is not three finite numbers", where)
        yield key, vector


def _check_link(link: ElementTree.Element, source: str, where: str) -> None:
    inertial = link.find("inertial")
    if inertial is None:
        return
    if (origin := inertial.find("origin")) is not None:
        dict(_vectors(origin, source, where))
    (mass,) = _numbers(inertial.find("mass"), ("value",), source, where)
    if mass < 0:
        raise UrdfError(source, f"mass is {mass} kg; it must not be negative", where)
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    xx, xy, xz, yy, yz, zz = _numbers(inertial.find("inertia"), keys, source, where)
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if not np.any(moments):
        return  # a point mass
    if moments[0] <= -1e-9 * moments[-1] or moments[-1] <= 0:
        raise UrdfError(source, f"inertia is not positive definite: principal moments {moments} kg m²", where)
    if moments[0] + moments[1] < moments[2] * (1 - _TRIANGLE_TOLERANCE):
        raise UrdfError(
            source, f"inertia breaks the triangle inequality: principal moments {moments} kg m²; "
            "no body has one larger than the other two together", where,
        )  # fmt: skip


def _check_joint(joint: ElementTree.Element, source: str, where: str, links: dict[str, ElementTree.Element]) -> None:
    kind = joint.get("type", "")
    if kind not in (*MOVING, "fixed"):
        raise UnsupportedJointError(source, f"type {kind!r} is none of {', '.join(MOVING)}, fixed", where)
    for tag in ("parent", "child"):
        element = joint.find(tag)
        link = None if element is None else element.get("link")
        if link not in links:
            raise UrdfError(source, f"{tag} link {link!r} does not exist", where)
    if (origin := joint.find("origin")) is not None:
        dict(_vectors(origin, source, where))
    if kind == "fixed":
        return
    if (axis := joint.find("axis")) is not None:
        for _, vector in _vectors(axis, source, where):
            if not np.any(vector):
                raise UrdfError(source, "axis is zero", where)
    limit = joint.find("limit")
    if limit is None:
        if kind == "continuous":
            return
        raise UrdfError(source, f"a {kind} joint needs <limit lower upper effort velocity>; it has none", where)
    for key, value in zip(("effort", "velocity"), _numbers(limit, ("effort", "velocity"), source, where), strict=True):
        if value < 0:
            raise UrdfError(source, f"{key} limit is {value}; it must not be negative", where)
    if kind != "continuous":
        given = {key: limit.get(key) for key in ("lower", "upper") if limit.get(key) is not None}
        numbers = dict(zip(given, _numbers(limit, tuple(given), source, where), strict=True))
        lower, upper = numbers.get("lower", 0.0), numbers.get("upper", 0.0)
        if lower > upper:
            raise UrdfError(source, f"lower limit {lower} is above upper limit {upper}", where)


def _check_tree(links: dict[str, ElementTree.Element], joints: dict[str, ElementTree.Element], source: str) -> None:
    parent: dict[str, str] = {}
    for name, joint in joints.items():
        up, down = (str(joint.find(tag).get("link")) for tag in ("parent", "child"))  # type: ignore[union-attr]
        if down in parent:
            raise UrdfError(source, f"link {down!r} is the child of two joints", f"joint {name!r}")
        parent[down] = up
    roots = [link for link in links if link not in parent]
    if len(roots) > 1:
        raise UrdfError(source, f"has {len(roots)} roots, {', '.join(roots[:5])}; a robot is one tree")
    reached = set(roots)
    children: dict[str, list[str]] = {}
    for down, up in parent.items():
        children.setdefault(up, []).append(down)
    stack = list(roots)
    while stack:
        for link in children.get(stack.pop(), []):
            reached.add(link)
            stack.append(link)
    if len(reached) < len(links):
        lost = sorted(set(links) - reached)
        raise UrdfError(source, f"has a cycle through {', '.join(lost[:5])}; a robot is one tree")
