"""Settings of an MJCF: `<compiler>` and gravity."""

import re
from dataclasses import dataclass
from typing import Self
from xml.etree.ElementTree import Element

import numpy as np
from numpy.typing import NDArray

from armdyn.errors import UrdfError
from armdyn.models.mjcf.values import Values

_GRAVITY = (0.0, 0.0, -9.81)
_FLAGS = ("true", "false")


@dataclass(frozen=True, kw_only=True)
class Compiler:
    """The settings of `<compiler>` that concern dynamics.

    Attributes:
        radians: in the unit of ranges, axisangle and euler.
        eulerseq: the axes of euler.
        automatic: a range that is given is in force unless it is said that it is not.
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
            UrdfError: one is none, or changes the bodies in a way that armdyn does not know.
        """
        given: dict[str, str] = {}
        for compiler in root.findall("compiler"):
            given |= compiler.attrib
        values = Values(given, source, "<compiler>")
        values.word("coordinate", ("local",))
        if values.number("settotalmass", -1.0) >= 0:
            raise UrdfError(source, "settotalmass rescales all bodies; give them their masses", "<compiler>")
        eulerseq = given.get("eulerseq", "xyz")
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


def gravity(root: Element, source: str) -> NDArray[np.float64]:
    """Gravity [m/s²], shape (3,), of an MJCF.

    Raises:
        UrdfError: it is not three numbers, or the arm is in a fluid.
    """
    given: dict[str, str] = {}
    for option in root.findall("option"):
        given |= option.attrib
    values = Values(given, source, "<option>")
    for key in ("density", "viscosity"):
        if values.number(key, 0.0):
            raise UrdfError(source, f"{key}: armdyn knows no drag of a fluid", "<option>")
    if any(flag.get("gravity") == "disable" for flag in root.findall("option/flag")):
        return np.zeros(3)
    return np.array(values.numbers("gravity", 3) or _GRAVITY)
