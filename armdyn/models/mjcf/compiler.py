"""Settings of an MJCF, `<compiler>` and gravity; placements, in whose notation they are written."""

import re
from dataclasses import dataclass
from typing import Self
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.errors import UrdfError
from armdyn.models.mjcf.classes import ROTATIONS, Values
from armdyn.models.reading.urdf_xml import clipped

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
            raise UrdfError(source, "settotalmass rescales all bodies; give them their masses", "<compiler>")
        eulerseq = values.given.get("eulerseq", "xyz")
        if not re.fullmatch("[xyzXYZ]{3}", eulerseq):
            raise UrdfError(source, "eulerseq is not three of x, y, z", "<compiler>")
        first, last = values.numbers("inertiagrouprange", 2) or (0.0, np.inf)
        return cls(
            radians=1.0 if values.word("angle", ("degree", "radian")) == "radian" else float(np.pi / 180),
            eulerseq=eulerseq,
            automatic=values.word("autolimits", _FLAGS) == "true",
            inertia_from=values.word("inertiafromgeom", ("auto", *_FLAGS)),
            groups=(first, last),
            least_mass=values.positive("boundmass", 0.0),
            least_inertia=values.positive("boundinertia", 0.0),
        )


def gravity(root: Element, source: str) -> Array:
    """Gravity [m/s²], shape (3,), of an MJCF.

    Raises:
        UrdfError: it is not three numbers, or the arm is in a fluid.
    """
    values = Values.of_all(root, "option", source)
    for key in ("density", "viscosity"):
        if values.number(key, 0.0):
            raise UrdfError(source, f"{key}: armdyn supports no drag of a fluid", "<option>")
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
        raise UrdfError(values.source, f"is turned by {' and by '.join(ways)}; one is enough", values.where)
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
        return _from_z(z)
    x = _direction(numbers[:3], values, way)
    y = _direction(numbers[3:] - x * (x @ numbers[3:]), values, way)
    return pin.Quaternion(np.column_stack([x, y, np.cross(x, y)]))


def _from_z(z: np.ndarray) -> pin.Quaternion:
    """The least turn that brings the z axis to a unit vector; half a turn about x where it is the opposite."""
    if z[2] < -1 + _SHORTEST**2:
        return pin.Quaternion(0.0, 1.0, 0.0, 0.0)
    return pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), z)


def _direction(vector: np.ndarray, values: Values, way: str) -> np.ndarray:
    length = np.linalg.norm(vector)
    if length < _SHORTEST:
        raise UrdfError(values.source, f"{way}={clipped(values.given[way])!r} is no direction", values.where)
    return np.asarray(vector / length)
