"""Attributes of elements of an MJCF: completed by defaults, read as numbers and placements by its compiler settings."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.errors import UrdfError
from armdyn.models.reading.urdf_xml import clipped, finite_numbers

ROTATIONS = {"quat": 4, "axisangle": 4, "euler": 3, "xyaxes": 6, "zaxis": 3}
"""Notations of a rotation, and their counts of numbers."""


MAIN = "main"
"""MuJoCo's name of the class of elements that name none."""

MAX_CLASSES = 1000
"""An MJCF of more default classes is refused: each holds a copy of inherited attributes."""

_ACTUATORS = "motor general position velocity intvelocity damper cylinder muscle adhesion dcmotor orientation plugin"
ACTUATORS = frozenset(_ACTUATORS.split())
"""Kinds of actuators; in a class they all set the defaults of one and the same."""

_KINDS = frozenset(("joint", "geom", "site", "general"))
_ATTRIBUTES = """
    type axis pos quat axisangle euler xyaxes zaxis range limited damping frictionloss armature stiffness ref
    actuatorfrcrange actuatorfrclimited size fromto mass density mesh shellinertia group
    ctrlrange ctrllimited forcerange forcelimited gear gainprm gaintype biastype dyntype
"""
_KEYS = frozenset(_ATTRIBUTES.split())
"""Attributes that are read; no others are kept, for every class has a copy of those that it inherits."""


@dataclass(frozen=True)
class Values:
    """The attributes of one element.

    Attributes:
        given: as text, completed by the element's class.
        source: name of the MJCF, in messages.
        where: name of the element, in messages.
    """

    given: Mapping[str, str]
    source: str
    where: str

    @classmethod
    def of_all(cls, root: Element, tag: str, source: str) -> "Values":
        """The attributes of all elements of a kind directly inside another; of several the last counts."""
        return cls(dict(pair for one in root.findall(tag) for pair in one.attrib.items()), source, f"<{tag}>")

    def error(self, what: str) -> UrdfError:
        """An error about the element, to raise."""
        return UrdfError(self.source, what, self.where)

    def numbers(self, key: str, least: int, most: int | None = None) -> list[float]:
        """Parse an attribute of several finite numbers; empty if it is missing.

        Raises:
            UrdfError: it is something else.
        """
        if key not in self.given:
            return []
        return finite_numbers(self.given[key], key, self.source, self.where, least, most)

    def number(self, key: str, default: float) -> float:
        """One finite number."""
        return (self.numbers(key, 1) or [default])[0]

    def positive(self, key: str) -> float:
        """One finite number that is not negative; 0 if it is missing."""
        value = self.number(key, 0.0)
        if value < 0:
            raise self.error(f"{key} is {value}; it must not be negative")
        return value

    def word(self, key: str, known: tuple[str, ...]) -> str:
        """One of some words, the first if the attribute is missing."""
        text = self.given.get(key, known[0])
        if text not in known:
            raise self.error(f"{key}={clipped(text)!r} is none of {', '.join(known)}")
        return text

    def bounds(self, key: str, flag: str, automatic: bool) -> tuple[float, float] | None:
        """Range of an attribute; None if it is absent or switched off.

        Args:
            key: the range's attribute.
            flag: the attribute that says whether it is in force.
            automatic: whether it is in force without the flag.
        """
        limited = self.word(flag, ("auto", "true", "false"))
        pair = self.numbers(key, 2)
        if limited == "false" or not pair or (limited == "auto" and not automatic):
            return None
        lower, upper = pair
        if lower > upper:
            raise self.error(f"{key}: {lower} is above {upper}")
        return lower, upper

    def copy(self, to: Element, key: str, least: int, most: int | None = None) -> list[float]:
        """Copy the numbers of an attribute to another element, if this one has them."""
        values = self.numbers(key, least, most)
        if values:
            to.set(key, " ".join(map(repr, values)))
        return values


@dataclass(frozen=True)
class Classes:
    """Default attributes by class and kind of element.

    Attributes:
        source: name of the MJCF, in messages.
        table: class to kind to attributes, those of the class around it included.
    """

    source: str
    table: Mapping[str, Mapping[str, Mapping[str, str]]]

    @classmethod
    def of(cls, root: Element, source: str) -> "Classes":
        """The classes of an MJCF.

        Raises:
            UrdfError: a class inside another has no name, or there are too many.
        """
        table: dict[str, dict[str, dict[str, str]]] = {MAIN: {}}
        for default in root.findall("default"):
            _fill(default, MAIN, table, source)
            if name := default.get("class"):
                table[name] = table[MAIN]
        return cls(source, table)

    def attributes(self, element: Element, inherited: str | None = None) -> dict[str, str]:
        """An element's attributes, completed by its class.

        Args:
            element: of the MJCF.
            inherited: `childclass` of the nearest body around it that has one.

        Raises:
            UrdfError: there is no such class.
        """
        name = element.get("class") or inherited or MAIN
        if name not in self.table:
            raise UrdfError(self.source, f"class {clipped(name)!r} is not defined", f"<{clipped(element.tag)}>")
        own = self.table[name].get(_kind(element.tag), {})
        if ROTATIONS.keys() & element.attrib.keys():  # its own way of being turned is instead of the class's
            own = {key: text for key, text in own.items() if key not in ROTATIONS}
        return {**own, **element.attrib}


def _kind(tag: str) -> str:
    return "general" if tag in ACTUATORS else tag


def _fill(default: Element, name: str, table: dict[str, dict[str, dict[str, str]]], source: str) -> None:
    own = table[name]
    for element in default:
        if (kind := _kind(element.tag)) in _KINDS:
            own[kind] = own.get(kind, {}) | {key: text for key, text in element.attrib.items() if key in _KEYS}
    for inside in default.findall("default"):
        if not (called := inside.get("class")):
            raise UrdfError(source, "a <default> inside another has no class")
        if len(table) > MAX_CLASSES:
            raise UrdfError(source, f"has more than {MAX_CLASSES} default classes")
        table[called] = {kind: dict(attributes) for kind, attributes in own.items()}
        _fill(inside, called, table, source)


_GRAVITY = (0.0, 0.0, -9.81)
_FLAGS = ("true", "false")
_SHORTEST = 1e-6
"""Least length of a direction."""


@dataclass(frozen=True, kw_only=True)
class Compiler:
    """The settings of `<compiler>` that concern dynamics.

    Attributes:
        radians: in the unit of ranges, axisangle and euler.
        eulerseq: the axes of euler.
        automatic: a given range is in force unless switched off.
        inertia_from: whether inertias come from geometry: "auto", where there is no `<inertial>`, "true" or "false".
        groups: first and last group of geometry that gives inertia.
        least_mass: of a body [kg].
        least_inertia: of a body's moments [kg m²].
    """

    radians: float
    eulerseq: str
    automatic: bool
    inertia_from: str
    groups: tuple[float, float]
    least_mass: float
    least_inertia: float

    @classmethod
    def of(cls, root: Element, source: str) -> Self:
        """The settings of an MJCF; of several the last counts.

        Raises:
            UrdfError: a setting is malformed, or changes the bodies in a way that armdyn does not support.
        """
        values = Values.of_all(root, "compiler", source)
        values.word("coordinate", ("local",))
        if values.number("settotalmass", -1.0) >= 0:
            raise values.error("settotalmass rescales all bodies; give them their masses")
        eulerseq = values.given.get("eulerseq", "xyz")
        if not re.fullmatch("[xyzXYZ]{3}", eulerseq):
            raise values.error("eulerseq is not three of x, y, z")
        first, last = values.numbers("inertiagrouprange", 2) or (0.0, np.inf)
        return cls(
            radians=1.0 if values.word("angle", ("degree", "radian")) == "radian" else float(np.pi / 180),
            eulerseq=eulerseq,
            automatic=values.word("autolimits", _FLAGS) == "true",
            inertia_from=values.word("inertiafromgeom", ("auto", *_FLAGS)),
            groups=(first, last),
            least_mass=values.positive("boundmass"),
            least_inertia=values.positive("boundinertia"),
        )


def gravity(root: Element, source: str) -> Array:
    """Gravity [m/s²], shape (3,), of an MJCF.

    Raises:
        UrdfError: it is not three numbers, or the arm is in a fluid.
    """
    values = Values.of_all(root, "option", source)
    for key in ("density", "viscosity"):
        if values.number(key, 0.0):
            raise values.error(f"{key}: armdyn supports no drag of a fluid")
    if any(flag.get("gravity") == "disable" for flag in root.findall("option/flag")):
        return np.zeros(3)
    return np.array(values.numbers("gravity", 3) or _GRAVITY)


def place(values: Values, compiler: Compiler, to: Element) -> None:
    """Give an element the placement of another's attributes, rotated by a unit quaternion.

    Pinocchio 4.1 takes an axis of another length than 1 for a rotation that it is not.

    Raises:
        UrdfError: it is turned in two ways, or about no axis.
    """
    values.copy(to, "pos", 3)
    ways = [way for way in ROTATIONS if way in values.given]
    if len(ways) > 1:
        raise values.error(f"is turned by {' and by '.join(ways)}; one is enough")
    for way in ways:
        turned = _rotation(values, way, compiler)
        to.set("quat", " ".join(repr(float(x)) for x in (turned.w, turned.x, turned.y, turned.z)))


def _rotation(values: Values, way: str, compiler: Compiler) -> pin.Quaternion:
    numbers = np.array(values.numbers(way, ROTATIONS[way]))
    if way == "euler":
        turned = pin.Quaternion.Identity()
        for letter, angle in zip(compiler.eulerseq, numbers, strict=True):
            axis = np.eye(3)["xyz".index(letter.lower())]
            one = pin.Quaternion(pin.AngleAxis(compiler.radians * angle, axis))
            turned = turned * one if letter.islower() else one * turned
        return turned
    if way == "quat":
        w, x, y, z = _direction(numbers, values, way)
        return pin.Quaternion(w, x, y, z)
    if way == "axisangle":
        axis = _direction(numbers[:3], values, way)
        return pin.Quaternion(pin.AngleAxis(compiler.radians * numbers[3], axis))
    if way == "zaxis":
        z = _direction(numbers, values, way)
        if z[2] < -1 + _SHORTEST**2:  # of the opposite, half a turn about x
            return pin.Quaternion(0.0, 1.0, 0.0, 0.0)
        return pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), z)
    x = _direction(numbers[:3], values, way)
    y = _direction(numbers[3:] - x * (x @ numbers[3:]), values, way)
    return pin.Quaternion(np.column_stack([x, y, np.cross(x, y)]))


def _direction(vector: np.ndarray, values: Values, way: str) -> np.ndarray:
    length = np.linalg.norm(vector)
    if length < _SHORTEST:
        raise values.error(f"{way}={clipped(values.given[way])!r} is no direction")
    return np.asarray(vector / length)
