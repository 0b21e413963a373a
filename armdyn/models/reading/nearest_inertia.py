"""Physical inertias nearest to unphysical ones, and a URDF's text with them."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal
from xml.etree.ElementTree import Element
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np

from armdyn.arrays import Array
from armdyn.models.reading.faults import Faults
from armdyn.models.reading.shape_inertia import InertiaEstimate
from armdyn.models.reading.urdf_check import MOMENTS, POINT_MASS, inertia_fault, inertia_tensor, numbers_of
from armdyn.models.reading.urdf_xml import clipped

THINNEST = 1e-3
"""Least radius of gyration along an axis that a changed body gets [m]: a sheet of 3.5 mm has it, no link is thinner."""

_LARGE, _COUNTS = 10.0, 0.01
"""Factor on a moment from which a repair is large, of moments of at least a part of the largest one."""
_UPPER = np.triu_indices(3)
"""Rows and columns of `MOMENTS` in the tensor."""
_POWERS = 9
"""Largest power of ten by which an entry may be off: g mm² for kg m²."""

_ROUNDED = 1e-9
"""Negative part of a second moment, in the largest, that is rounding of the numbers in a file."""

Large = Literal["no", "nearest", "power-of-ten"]
LARGE: tuple[Large, ...] = ("no", "nearest", "power-of-ten")
"""How large repairs are written, see `repair_urdf`."""

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

    @property
    def large(self) -> bool:
        """Whether it changes a moment by a factor of ten or more, so that it is written only on request."""
        before, after = np.diag(self.before), np.diag(self.after)
        counts = after > _COUNTS * np.max(after)
        return bool(np.any(counts & (after >= _LARGE * np.abs(before))) or np.any(before >= _LARGE * after))

    def chosen(self, large: str) -> Array | None:
        """The inertia to write [kg m²], shape (3, 3); None: it stays. See `repair_urdf`."""
        if large == "power-of-ten" and self.large and self.power_of_ten:
            return self.power_of_ten[1]
        return self.after if large == "nearest" or not self.large else None

    @property
    def power_of_ten(self) -> tuple[str, Array] | None:
        """The entry that alone, times the least power of ten, makes a physical inertia, and that inertia [kg m²]."""
        for power in sorted(range(-_POWERS, _POWERS + 1), key=lambda power: (abs(power), power)):
            for key, i, j in zip(MOMENTS, *_UPPER, strict=True):
                changed = self.before.copy()
                changed[i, j] = changed[j, i] = self.before[i, j] * 10.0**power
                thin, *_, wide = np.linalg.eigvalsh(second_moments(changed))
                if not inertia_fault(changed) and thin >= 0 and wide >= self.mass * THINNEST**2:
                    return key, changed
        return None


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
    found = (inertia_repair(link, source) for link in root.findall("link"))
    return tuple(one for one in found if one is not None and one.mass > 0)


def inertia_repair(link: Element, source: str) -> InertiaRepair | None:
    """The unphysical inertia of a link and the nearest physical one; None: it is physical, or that of a point.

    Args:
        link: of a URDF; a mass that is no mass [kg] counts as 0.
        source: name of the file or text, in messages.

    Raises:
        UrdfError: the inertia is not six numbers.
    """
    if (inertial := link.find("inertial")) is None:
        return None
    where = f"link {clipped(link.get('name'))!r}"
    tensor = inertia_tensor(inertial, source, where)
    least, *_, largest = np.linalg.eigvalsh(second_moments(tensor))
    fault, most = inertia_fault(tensor), np.linalg.eigvalsh(tensor)[-1]
    if np.max(np.abs(tensor)) < POINT_MASS or not (fault or least < -_ROUNDED * largest):
        return None
    known = Faults(source).of(numbers_of, inertial, "mass", source, where)
    mass = known["value"][0] if known else 0.0
    if fault and mass * most > 0:
        fault += f"; its radius of gyration is {np.sqrt(most / mass):.3g} m with {mass:g} kg"
    after = nearest_physical(mass, tensor)
    return InertiaRepair(link=str(link.get("name")), fault=fault, mass=mass, before=tensor, after=after)


def with_inertias(text: str, changed: Mapping[str, Array], estimates: Sequence[InertiaEstimate] = ()) -> str:
    """Replace inertias in a URDF's text and write estimated ones, nothing else, and mark it as repaired.

    Args:
        text: URDF that `urdf_check.parse_urdf` accepts.
        changed: inertias about the centre of mass [kg m²], shape (3, 3), by the names of the links.
        estimates: inertias of links that have no mass.
    """
    if not (changed or estimates):
        return text
    data = text.encode()
    places = _places(data)
    changes = []
    for link, tensor in changed.items():
        start, end = at = places[link, "inertia"]
        changes.append((at, _tag(tensor, "/>" if data[start:end].endswith(b"/>") else ">")))
    for one in estimates:
        at = places.get((one.link, "inertial"), 2 * places[one.link, "link"][1:])
        xyz, tag = " ".join(map(repr, one.com.tolist())), _tag(one.inertia.inertia)
        changes.append((at, f'<inertial><origin xyz="{xyz}"/><mass value="{one.mass!r}"/>{tag}</inertial>'))
    names = quoteattr(", ".join([*changed, *(one.link for one in estimates)]))
    for (start, end), written in sorted(changes, reverse=True):
        data = data[:start] + written.encode() + data[end:]
    _, end = places["", "robot"]
    return (data[:end] + f"\n  <{MARK} repaired={names}/>".encode() + data[end:]).decode()


def _tag(tensor: Array, closing: str = "/>") -> str:
    """A tag `<inertia>`."""
    words = (f'{key}="{value!r}"' for key, value in zip(MOMENTS, tensor[_UPPER].tolist(), strict=True))
    return f"<inertia {' '.join(words)}{closing}"


def _places(data: bytes) -> Mapping[tuple[str, str], tuple[int, int]]:
    """First and last byte of links' tags `<link>`, `<inertia>` and elements `<inertial>`, and of the tag `<robot>`."""
    parser = expat.ParserCreate("utf-8")
    way: list[tuple[str, str, int]] = []
    found: dict[tuple[str, str], tuple[int, int]] = {}

    def place() -> tuple[str, str] | None:
        tags = [tag for tag, *_ in way]
        of_link = tags[:2] == ["robot", "link"] and tags[2:] in ([], ["inertial"], ["inertial", "inertia"])
        return (way[1][1], tags[-1]) if of_link else ("", "robot") if len(way) == 1 else None

    def start(tag: str, attributes: dict[str, str]) -> None:
        begin = parser.CurrentByteIndex
        way.append((tag, attributes.get("name", ""), begin))
        if (here := place()) is not None:
            found.setdefault(here, (begin, begin + len(_TAG.match(data, begin)[0])))  # type: ignore[index]  # expat has read it

    def end(tag: str) -> None:
        here = place() if tag == "inertial" else None
        begin = way.pop()[2]
        if here is not None and found[here][0] == begin:
            found[here] = begin, max(found[here][1], data.index(b">", parser.CurrentByteIndex) + 1)

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.Parse(data, True)
    return found
