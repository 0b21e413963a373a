"""Checks of an untrusted URDF, before Pinocchio reads it."""

from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from xml.etree import ElementTree

import numpy as np

from armdyn.arrays import Array
from armdyn.errors import UnsupportedJointError, UrdfError
from armdyn.models.reading.faults import Faults
from armdyn.models.reading.urdf_xml import LARGEST, clipped, finite_numbers, parse_xml

MAX_LINKS = 1000
"""A URDF of more links is refused: readers descend link by link. The largest known robots have 200."""

MAX_MOVING = 150
"""A URDF of more moving joints is refused: Pinocchio's memory grows with their cube, 0.2 GiB for 150."""

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


def parse_urdf(text: str, source: str, faults: Faults | None = None) -> ElementTree.Element:
    """The checked XML tree of a URDF: no DTD, no entity, bounded size, one tree of joints, finite numbers.

    Inertias are checked by `dynamics_check.check_dynamics`, when the moving links are known.

    Args:
        text: the URDF.
        source: name of the file or text, in messages.
        faults: list to which those of links and joints are added; None: they are raised.

    Raises:
        UrdfError: not XML, no URDF, or links or joints make no sense, with the names of all and the remedy.
        UnsupportedJointError: a joint is neither revolute, continuous, prismatic nor fixed.
    """
    found = Faults(source) if faults is None else faults
    root = parse_xml(text, source)
    if root.tag == "mujoco":
        raise UrdfError(source, "is MJCF, no URDF; Robot.from_mjcf reads it")
    if root.tag != "robot":
        raise UrdfError(source, f"the root element is <{clipped(root.tag)}>, not <robot>: this is XML but no URDF")
    if not root.get("name"):
        found.add("<robot> has no name")
    links, joints = (_named(root, tag, source, found) for tag in ("link", "joint"))
    if not root.findall("link"):
        raise UrdfError(source, "has no <link>")
    if sum(joint.get("type") in MOVING for joint in joints.values()) > MAX_MOVING:
        raise UrdfError(source, f"has more than {MAX_MOVING} joints that move")
    for name, link in links.items():
        if (inertial := link.find("inertial")) is not None:
            for tag in _OF_BODIES:
                found.of(numbers_of, inertial, tag, source, f"link {clipped(name)!r}")
    for name, joint in joints.items():
        _check_joint(joint, source, f"joint {clipped(name)!r}", links, found)
    _check_tree(links, joints, found)
    if faults is None:
        found.raise_together()
    return root


def inertia_tensor(inertial: ElementTree.Element, source: str, where: str) -> Array:
    """The inertia of an `<inertial>` about the centre of mass [kg m²], shape (3, 3)."""
    xx, xy, xz, yy, yz, zz = (one[0] for one in numbers_of(inertial, "inertia", source, where).values())
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


def _named(root: ElementTree.Element, tag: str, source: str, faults: Faults) -> dict[str, ElementTree.Element]:
    found: dict[str, ElementTree.Element] = {}
    for element in root.findall(tag):
        name = element.get("name")
        if not name:
            faults.add(f"a <{tag}> has no name")
            continue
        if name in found:
            faults.add("is defined twice", f"{tag} {clipped(name)!r}")
        found[name] = element
        if len(found) > MAX_LINKS:
            raise UrdfError(source, f"has more than {MAX_LINKS} {tag}s")
    return found


def numbers_of(parent: ElementTree.Element, tag: str, source: str, where: str) -> dict[str, list[float]]:
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


def _check_joint(
    joint: ElementTree.Element, source: str, where: str, links: Mapping[str, ElementTree.Element], faults: Faults
) -> None:
    if (kind := joint.get("type", "")) not in (*MOVING, "fixed"):
        what = f"type {clipped(kind)!r} is none of {', '.join(MOVING)}, fixed"
        faults.append(UnsupportedJointError(source, what, where))
    for tag in ("parent", "child"):
        if (link := end_of(joint, tag)) not in links:
            faults.add(f"{tag} link {clipped(link)!r} does not exist", where)
    tags = ("origin", *(_MOVED if kind in MOVING else ()))
    found = {tag: faults.of(numbers_of, joint, tag, source, where) or {} for tag in tags}
    if kind not in MOVING:
        return
    axis = found["axis"].get("xyz", [1.0])
    if not 1e-6 < np.linalg.norm(axis) < 1e6:  # readers divide by it
        faults.add(f"axis is {np.array(axis)}; its length should be 1" if np.any(axis) else "axis is zero", where)
    if joint.find("limit") is None and kind != "continuous":
        faults.add(f"a {kind} joint needs <limit lower upper effort velocity>; it has none", where)
    lower, upper = (found["limit"].get(key, [0.0])[0] for key in ("lower", "upper"))
    if kind != "continuous" and lower > upper:
        faults.add(f"lower limit {lower} is above upper limit {upper}", where)


def end_of(joint: ElementTree.Element, tag: str) -> str:
    """Name of a joint's parent or child; empty: there is none."""
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def _check_tree(
    links: Mapping[str, ElementTree.Element], joints: Mapping[str, ElementTree.Element], faults: Faults
) -> None:
    parent: dict[str, str] = {}
    for name, joint in joints.items():
        up, down = end_of(joint, "parent"), end_of(joint, "child")
        if down in parent and down in links:
            faults.add(f"link {clipped(down)!r} is the child of two joints", f"joint {clipped(name)!r}")
        parent[down] = up
    roots = [link for link in links if link not in parent]
    if len(roots) > 1 and {*parent, *parent.values()} <= links.keys():  # not for want of a link or its name
        faults.add(f"has {len(roots)} roots, {clipped(', '.join(roots[:5]))}; a robot is one tree")
    try:
        TopologicalSorter({down: [up] for down, up in parent.items()}).prepare()
    except CycleError as error:
        around = clipped(", ".join(sorted(set(error.args[1]))[:5]))
        faults.add(f"has a cycle through {around}; a robot is one tree")
