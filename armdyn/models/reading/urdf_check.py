"""Checks of an untrusted URDF, before Pinocchio reads it."""

from collections.abc import Callable, Set
from graphlib import CycleError, TopologicalSorter
from typing import Self
from xml.etree import ElementTree

import numpy as np

from armdyn.arrays import Array
from armdyn.errors import UnsupportedJointError, UrdfError
from armdyn.models.reading.urdf_xml import LARGEST, clipped, finite_numbers, parse_xml

MAX_LINKS = 1000
"""A URDF of more links is refused: readers descend link by link. The largest known robots have 200."""

MAX_MOVING = 150
"""A URDF of more moving joints is refused: Pinocchio's memory grows with their cube, 0.2 GiB for 150."""

_MOST_SAID = 7
"""Largest number of further faults in one message."""

MOVING = ("revolute", "continuous", "prismatic")
MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_TRIANGLE_TOLERANCE = 1e-2  # published URDFs round principal moments to two or three digits
POINT_MASS = 1e-12
"""Inertias below are those of point masses [kg m²]: published ones are a rounding, 1e-17, off zero."""

_KEPT: dict[str, tuple[str, ...]] = {
    "inertial": (),
    "origin": ("xyz", "rpy"),
    "mass": ("value",),
    "inertia": MOMENTS,
    "parent": ("link",),
    "child": ("link",),
    "axis": ("xyz",),
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction"),
}
"""Elements and attributes that dynamics need."""

_MOVED = ("axis", "limit", "dynamics")
"""Elements of joints that move."""
_OF_BODIES = ("origin", "mass", "inertia")
"""Elements of an `<inertial>`."""

_NOT_NEGATIVE = {
    "value": "mass is {} kg",
    "effort": "effort limit is {}",
    "velocity": "velocity limit is {}",
    "damping": "damping is {}",
    "friction": "friction is {}",
}


def parse_urdf(text: str, source: str) -> ElementTree.Element:
    """The checked XML tree of a URDF: no DTD, no entity, bounded size, one tree of joints, finite numbers.

    Inertias are checked by `check_inertias`, when the moving links are known.

    Args:
        text: the URDF.
        source: name of the file or text, in messages.

    Raises:
        UrdfError: not XML, no URDF, or a link or joint makes no sense, with its name and the remedy.
        UnsupportedJointError: a joint is neither revolute, continuous, prismatic nor fixed.
    """
    root = parse_xml(text, source)
    if root.tag == "mujoco":
        raise UrdfError(source, "is MJCF, no URDF; Robot.from_mjcf reads it")
    if root.tag != "robot":
        raise UrdfError(source, f"the root element is <{clipped(root.tag)}>, not <robot>: this is XML but no URDF")
    if not root.get("name"):
        raise UrdfError(source, "<robot> has no name")
    links = _named(root, "link", source)
    joints = _named(root, "joint", source)
    if not links:
        raise UrdfError(source, "has no <link>")
    if sum(joint.get("type") in MOVING for joint in joints.values()) > MAX_MOVING:
        raise UrdfError(source, f"has more than {MAX_MOVING} joints that move")
    with _Faults() as faults:
        for name, link in links.items():
            if (inertial := link.find("inertial")) is not None:
                for tag in _OF_BODIES:
                    faults.of(_numbers, inertial, tag, source, f"link {clipped(name)!r}")
        for name, joint in joints.items():
            faults.of(_check_joint, joint, source, f"joint {clipped(name)!r}", links)
    _check_tree(links, joints, source)
    return root


def check_inertias(root: ElementTree.Element, source: str, moving: Set[str]) -> None:
    """Refuse inertias of moving links that no body has.

    Args:
        root: of `parse_urdf`.
        source: name of the file or text, in messages.
        moving: the names of the links that move.

    Raises:
        UrdfError: principal moments are negative, or one is larger than the other two together.
    """
    with _Faults() as faults:
        for link in root.findall("link"):
            if (inertial := link.find("inertial")) is not None and link.get("name") in moving:
                faults.of(_check_inertia, inertial, source, f"link {clipped(link.get('name'))!r}")


def _check_inertia(inertial: ElementTree.Element, source: str, where: str) -> None:
    tensor = inertia_tensor(inertial, source, where)
    if fault := inertia_fault(tensor):
        mass, most = _numbers(inertial, "mass", source, where)["value"][0], np.linalg.eigvalsh(tensor)[-1]
        if mass * most > 0:
            fault += f"; its radius of gyration is {np.sqrt(most / mass):.3g} m with {mass:g} kg"
        raise UrdfError(source, f"{fault}; `armdyn doctor FILE --repair` shows the nearest physical one", where)


class _Faults:
    """Faults of a URDF's elements: the first is raised, and tells the others."""

    def __init__(self) -> None:
        self._found: list[UrdfError] = []

    def of(self, check: Callable[..., object], *arguments: object) -> None:
        """Run a check."""
        try:
            check(*arguments)
        except UrdfError as error:
            self._found.append(error)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if not self._found:
            return
        first, *more = self._found
        if more:
            said = "; ".join(str(one).removeprefix(f"{one.source}: ") for one in more[:_MOST_SAID])
            left = f"; and {len(more) - _MOST_SAID} others" if len(more) > _MOST_SAID else ""
            first.args = (f"{first}; {len(more)} more: {said}{left}",)
        raise first


def inertia_tensor(inertial: ElementTree.Element, source: str, where: str) -> Array:
    """The inertia of an `<inertial>` about the centre of mass [kg m²], shape (3, 3)."""
    xx, xy, xz, yy, yz, zz = (one[0] for one in _numbers(inertial, "inertia", source, where).values())
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def inertia_fault(tensor: Array) -> str:
    """Fault, in words, of an inertia about the centre of mass [kg m²], shape (3, 3), that no body has; else empty."""
    if np.max(np.abs(tensor)) < POINT_MASS:
        return ""  # a point mass
    moments = np.linalg.eigvalsh(tensor)
    if moments[0] <= -1e-9 * moments[-1] or moments[-1] <= 0:
        return f"inertia is not positive definite: principal moments {moments} kg m²"
    if moments[0] + moments[1] < moments[2] * (1 - _TRIANGLE_TOLERANCE):
        return (
            f"inertia breaks the triangle inequality: principal moments {moments} kg m²; "
            "no body has one larger than the other two together"
        )
    return ""


def dynamics_urdf(root: ElementTree.Element) -> str:
    """A checked URDF without elements that dynamics do not need: Pinocchio reads nothing unchecked."""
    bare = ElementTree.Element("robot", name=str(root.get("name")))
    for element in root:
        if element.tag not in ("link", "joint"):
            continue
        keys = ("name",) if element.tag == "link" else ("name", "type")
        copy = ElementTree.SubElement(bare, element.tag, {key: str(element.get(key)) for key in keys})
        fixed = ("parent", "child", "origin")  # a fixed joint's other elements were not checked
        more = () if element.get("type") == "fixed" else _MOVED
        tags = ("inertial",) if element.tag == "link" else (*fixed, *more)
        for tag in tags:
            _copy(element, tag, copy)
    return ElementTree.tostring(bare, encoding="unicode")


def _copy(parent: ElementTree.Element, tag: str, to: ElementTree.Element) -> None:
    element = parent.find(tag)
    if element is None:
        return
    missing = {"effort": "0", "velocity": "0"} if tag == "limit" else {}  # urdfdom needs both; 0: not known
    kept = missing | {key: element.attrib[key] for key in _KEPT[tag] if key in element.attrib}
    if "link" not in kept:
        kept = {key: " ".join(text.split()) for key, text in kept.items()}  # urdfdom stumbles over line ends
    copy = ElementTree.SubElement(to, tag, kept)
    if tag == "inertial":
        for inside in _OF_BODIES:
            _copy(element, inside, copy)


def _named(root: ElementTree.Element, tag: str, source: str) -> dict[str, ElementTree.Element]:
    found: dict[str, ElementTree.Element] = {}
    for element in root.findall(tag):
        name = element.get("name")
        if not name:
            raise UrdfError(source, f"a <{tag}> has no name")
        if name in found:
            raise UrdfError(source, "is defined twice", f"{tag} {clipped(name)!r}")
        found[name] = element
        if len(found) > MAX_LINKS:
            raise UrdfError(source, f"has more than {MAX_LINKS} {tag}s")
    return found


def _numbers(parent: ElementTree.Element, tag: str, source: str, where: str) -> dict[str, list[float]]:
    """Attributes of an element in another one, checked, as finite numbers; mass and inertia must be complete."""
    element, needed = parent.find(tag), _KEPT[tag] if tag in ("mass", "inertia") else ()
    if element is None:
        if needed:
            raise UrdfError(source, f"lacks the element with {', '.join(needed)}", where)
        return {}
    for key in needed:
        if key not in element.attrib:
            raise UrdfError(source, f"<{tag}> lacks {key}", where)
    largest, found = np.inf if tag in ("limit", "dynamics") else LARGEST, {}
    for key in (key for key in _KEPT[tag] if key in element.attrib):
        count = 3 if key in ("xyz", "rpy") else 1
        values = finite_numbers(element.attrib[key], f"<{tag}> {key}", source, where, count, largest=largest)
        if key in _NOT_NEGATIVE and values[0] < 0:
            raise UrdfError(source, f"{_NOT_NEGATIVE[key].format(values[0])}; it must not be negative", where)
        found[key] = values
    return found


def _check_joint(joint: ElementTree.Element, source: str, where: str, links: dict[str, ElementTree.Element]) -> None:
    kind = joint.get("type", "")
    if kind not in (*MOVING, "fixed"):
        raise UnsupportedJointError(source, f"type {clipped(kind)!r} is none of {', '.join(MOVING)}, fixed", where)
    for tag in ("parent", "child"):
        element = joint.find(tag)
        link = None if element is None else element.get("link")
        if link not in links:
            raise UrdfError(source, f"{tag} link {clipped(link)!r} does not exist", where)
    found = {tag: _numbers(joint, tag, source, where) for tag in ("origin", *(() if kind == "fixed" else _MOVED))}
    if kind == "fixed":
        return
    axis = found["axis"].get("xyz", [1.0])
    if not 1e-6 < np.linalg.norm(axis) < 1e6:  # readers divide by it
        what = f"axis is {np.array(axis)}; its length should be 1" if np.any(axis) else "axis is zero"
        raise UrdfError(source, what, where)
    if joint.find("limit") is None and kind != "continuous":
        raise UrdfError(source, f"a {kind} joint needs <limit lower upper effort velocity>; it has none", where)
    lower, upper = (found["limit"].get(key, [0.0])[0] for key in ("lower", "upper"))
    if kind != "continuous" and lower > upper:
        raise UrdfError(source, f"lower limit {lower} is above upper limit {upper}", where)


def _check_tree(links: dict[str, ElementTree.Element], joints: dict[str, ElementTree.Element], source: str) -> None:
    parent: dict[str, str] = {}
    for name, joint in joints.items():
        up, down = (str(joint.find(tag).get("link")) for tag in ("parent", "child"))  # type: ignore[union-attr]
        if down in parent:
            raise UrdfError(source, f"link {clipped(down)!r} is the child of two joints", f"joint {clipped(name)!r}")
        parent[down] = up
    roots = [link for link in links if link not in parent]
    if len(roots) > 1:
        raise UrdfError(source, f"has {len(roots)} roots, {clipped(', '.join(roots[:5]))}; a robot is one tree")
    try:
        TopologicalSorter({down: [up] for down, up in parent.items()}).prepare()
    except CycleError as error:
        around = clipped(", ".join(sorted(set(error.args[1]))[:5]))
        raise UrdfError(source, f"has a cycle through {around}; a robot is one tree") from None
