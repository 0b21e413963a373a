"""Physical inertias nearest to unphysical ones, and a URDF's text with them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from xml.etree.ElementTree import Element
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np

from armdyn.arrays import Array
from armdyn.models.reading.urdf_check import MOMENTS, POINT_MASS, inertia_fault, inertia_tensor

THINNEST = 1e-3
"""Least radius of gyration along an axis that a changed body gets [m]: a sheet of 3.5 mm has it, no link is thinner."""

_ROUNDED = 1e-9
"""Negative part of a second moment, in the largest, that is rounding of the numbers in a file."""

MARK = "armdyn"
"""Element of a repaired URDF's `<robot>`; its attribute `repaired` names the changed links."""

_TAG = re.compile(rb"<[^\s/>]+(?:\s+[^\s=]+\s*=\s*(?:\"[^\"]*\"|'[^']*'))*\s*/?>")


@dataclass(frozen=True, kw_only=True, eq=False)
class InertiaRepair:
    """Nearest physical inertia of a link; mass and centre of mass do not change.

    Attributes:
        link: name of the link.
        fault: why the file's inertia is unphysical; empty: it is a thin body's, rounded, which the reader accepts.
        mass: mass of the link [kg].
        before: inertia about the centre of mass in the file [kg m²], shape (3, 3).
        after: the nearest physical one [kg m²], shape (3, 3).
    """

    link: str
    fault: str
    mass: float
    before: Array
    after: Array

    @property
    def moments_before(self) -> Array:
        """Principal moments in the file [kg m²], ascending, shape (3,)."""
        return np.asarray(np.linalg.eigvalsh(self.before), dtype=float)

    @property
    def moments_after(self) -> Array:
        """Principal moments of the nearest physical inertia [kg m²], ascending, shape (3,)."""
        return np.asarray(np.linalg.eigvalsh(self.after), dtype=float)

    @property
    def change(self) -> float:
        """Distance of both pseudo-inertias, without the mass, as a fraction of the first (Frobenius norm)."""
        before = second_moments(self.before)
        return float(np.linalg.norm(second_moments(self.after) - before) / np.linalg.norm(before))


def second_moments(tensor: Array) -> Array:
    """Σ = ½ tr(I) 1 - I, the integral of x xᵀ dm about the centre of mass [kg m²], shape (3, 3).

    With the mass it is the pseudo-inertia there, diag(Σ, m): Wensing, Kim, Slotine: Linear Matrix Inequalities for
    Physically Consistent Inertial Parameter Identification, RA-L 2018, eq. (8).
    """
    return np.asarray(0.5 * np.trace(tensor) * np.eye(3) - tensor)


def nearest_physical(mass: float, tensor: Array, thinnest: float = THINNEST) -> Array:
    """The physical inertia about the centre of mass that is nearest to another [kg m²], shape (3, 3).

    An inertia is physical if the pseudo-inertia diag(Σ, m) is positive definite (Traversaro et al., IROS 2016;
    Wensing et al. 2018), which includes the triangle inequality of the principal moments. The nearest one in the
    Frobenius norm has the same eigenvectors, and eigenvalues clipped (Higham, Linear Algebra Appl. 103, 1988); here at
    m `thinnest`² instead of zero. Geometric distances (Lee, Park, RA-L 2018) are infinite from a tensor that is not
    physical.

    Args:
        mass: of the body [kg], positive.
        tensor: its inertia [kg m²], shape (3, 3), symmetric.
        thinnest: least radius of gyration along an axis [m].
    """
    values, vectors = np.linalg.eigh(second_moments(tensor))
    nearest = vectors @ np.diag(np.maximum(values, mass * thinnest**2)) @ vectors.T
    return np.asarray(np.trace(nearest) * np.eye(3) - nearest)


def repaired_inertias(root: Element, source: str) -> tuple[InertiaRepair, ...]:
    """Find the unphysical inertias of a URDF, and the nearest physical ones; the URDF stays unchanged.

    Massless links and point masses are left out.

    Args:
        root: of `urdf_check.parse_urdf`.
        source: name of the file or text, in messages.
    """
    found = []
    for link in root.findall("link"):
        if (inertial := link.find("inertial")) is None:
            continue
        name, mass = str(link.get("name")), float(inertial.find("mass").get("value", ""))  # type: ignore[union-attr]
        tensor = inertia_tensor(inertial, source, f"link {name!r}")
        if mass <= 0 or np.max(np.abs(tensor)) < POINT_MASS:
            continue
        least, *_, largest = np.linalg.eigvalsh(second_moments(tensor))
        if (fault := inertia_fault(tensor)) or least < -_ROUNDED * largest:
            after = nearest_physical(mass, tensor)
            found.append(InertiaRepair(link=name, fault=fault, mass=mass, before=tensor, after=after))
    return tuple(found)


def with_inertias(text: str, repairs: Sequence[InertiaRepair]) -> str:
    """Replace inertias in a URDF's text, nothing else, and mark it as repaired.

    Args:
        text: URDF that `urdf_check.parse_urdf` accepts.
        repairs: repairs of its links' inertias.
    """
    data = text.encode()
    places = _places(data, {repair.link for repair in repairs})
    changes = [(places[repair.link], _inertia_tag(repair)) for repair in repairs]
    names = quoteattr(", ".join(repair.link for repair in repairs))
    mark = f"\n  <{MARK} repaired={names}/>".encode()
    for (start, end), tag in sorted(changes, reverse=True):
        closing = b"/>" if data[:end].endswith(b"/>") else b">"
        data = data[:start] + tag + closing + data[end:]
    _, end = places[""]
    return (data[:end] + mark + data[end:]).decode()


def _inertia_tag(repair: InertiaRepair) -> bytes:
    rows = {key: float(repair.after["xyz".index(key[1]), "xyz".index(key[2])]) for key in MOMENTS}
    return " ".join(["<inertia", *(f'{key}="{value!r}"' for key, value in rows.items())]).encode()


def _places(data: bytes, links: set[str]) -> Mapping[str, tuple[int, int]]:
    """First and last byte of the tags `<inertia>` of some links, by their names, and of `<robot>`, by ""."""
    parser = expat.ParserCreate("utf-8")
    way: list[tuple[str, str]] = []
    found: dict[str, tuple[int, int]] = {}

    def start(tag: str, attributes: dict[str, str]) -> None:
        way.append((tag, attributes.get("name", "")))
        tags = [each for each, _ in way]
        link = way[1][1] if tags == ["robot", "link", "inertial", "inertia"] else "" if len(way) == 1 else None
        if link is not None and (link in links or not link) and link not in found:
            begin = parser.CurrentByteIndex
            found[link] = begin, begin + len(_TAG.match(data, begin)[0])  # type: ignore[index]  # expat has read it

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda tag: way.pop()
    parser.Parse(data, True)
    return found
