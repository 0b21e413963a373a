"""Placements in an MJCF: five notations of a rotation are read, one is written."""

from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from armdyn.errors import UrdfError
from armdyn.models.mjcf.compiler import Compiler
from armdyn.models.mjcf.values import ROTATIONS, Values
from armdyn.models.reading.urdf_xml import clipped

_SHORTEST = 1e-6
"""A direction of less length is none."""


def place(values: Values, compiler: Compiler, to: Element) -> None:
    """Give an element the placement that another's attributes say, turned by a unit quaternion.

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
