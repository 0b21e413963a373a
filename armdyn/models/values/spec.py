"""Planar arms and their payload, as numbers."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, Self, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import Checked, checked, each, expect, number, numbers, several, shown, text
from armdyn.arrays import Array
from armdyn.errors import SpecError, reraised
from armdyn.models.values.placement import Placement, point, pose_rows
from armdyn.reprs import brief

GRAVITY = 9.81
"""Magnitude of gravity [m/s²], along -z of the world, in the plane of a generated arm."""


@dataclass(frozen=True, kw_only=True)
class LinkSpec(Checked):
    """One link of a planar arm.

    Attributes:
        length: joint to next joint, or to the tip [m].
        com: joint to centre of mass, along the link [m].
        mass: [kg].
        inertia: about the centre of mass, around the joint's axis [kg m²].
    """

    length: float = checked(number, name="length of a link", unit="m", sign="positive", error=SpecError)
    com: float = checked(number, name="com of a link", unit="m", error=SpecError)
    mass: float = checked(number, name="mass of a link", unit="kg", sign="positive", error=SpecError)
    inertia: float = checked(number, name="inertia of a link", unit="kg m²", sign="positive", error=SpecError)


PLANAR_LINKS = (
    LinkSpec(length=0.250, com=0.198, mass=0.193, inertia=1.15e-3),
    LinkSpec(length=0.234, com=0.143, mass=0.115, inertia=4.99e-4),
    LinkSpec(length=0.218, com=0.109, mass=0.100, inertia=6.58e-4),
)
"""Giv and Malek (2024), Table 1."""

_XML_TEXT = "[\t -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]+"
"""Characters of XML in one line."""

PlanarArmName = Literal["r", "rr", "rrr"]
PLANAR_ARMS: tuple[PlanarArmName, ...] = ("r", "rr", "rrr")


@brief
@dataclass(frozen=True, kw_only=True)
class ArmSpec(Checked):
    """A planar arm of revolute joints: R, RR, RRR and so on.

    Joint angles are relative; all zero is the arm stretched out horizontally; positive turns up,
    against gravity.

    Attributes:
        name: the robot's name in the URDF.
        links: base to tip.
        position_limit: every joint stays within ± this [rad].
        velocity_limit: every joint stays within ± this [rad/s]. A URDF needs one.
        effort_limit: every torque stays within ± this [N m].
    """

    name: str = checked(text, name="name of an arm", error=SpecError)
    links: tuple[LinkSpec, ...] = checked(each, of=expect, kind=LinkSpec, name="links of an arm", error=SpecError)
    position_limit: float = checked(number, float(np.pi), unit="rad", sign="positive", error=SpecError)
    velocity_limit: float = checked(number, 1000.0, unit="rad/s", sign="positive", error=SpecError)
    effort_limit: float = checked(number, 3.0, unit="N m", sign="positive", error=SpecError)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not re.fullmatch(_XML_TEXT, self.name):
            raise SpecError(f"name of an arm is {shown(self.name)}; a URDF can have no such characters")
        if not self.links:
            raise SpecError("links is empty: an arm needs at least one link")

    @classmethod
    def paper(cls, arm: PlanarArmName) -> Self:
        """The arm of Table 1 of Giv and Malek (2024) with one, two or three links.

        Raises:
            SpecError: `arm` is none of "r", "rr", "rrr".
        """
        if not (isinstance(arm, str) and arm in PLANAR_ARMS):
            raise SpecError(f"no planar arm is called {shown(arm)}; known: {', '.join(PLANAR_ARMS)}")
        return cls(name=arm, links=PLANAR_LINKS[: len(arm)])


@runtime_checkable
class BodyShape(Protocol):
    """A shape of `armdyn.models.scene.obstacles`, such as `Box`."""

    name: str

    def solids(self) -> list[tuple[Array, Any]]:
        """Convex solids that it consists of: placement, shape (4, 4) [m], and coal's geometry."""


def _moments(inertia: ArrayLike, name: str) -> tuple[float, ...]:
    """Check a payload's inertia [kg m²]: three moments, or three moments and three products."""
    expected = "three moments, three moments and three products, or a symmetric 3 × 3 matrix [kg m²]"
    array = numbers(inertia, name, expected, error=SpecError)
    if array.shape == (3, 3) and np.array_equal(array, array.T):
        array = np.concatenate([np.diag(array), array[np.triu_indices(3, 1)]])
    if array.shape not in ((3,), (6,)) or not np.all(np.isfinite(array)):
        raise SpecError(f"{name} is {shown(inertia)} kg m²; it must be finite: {expected}")
    return tuple(array.tolist())


def _body_shapes(shapes: object, name: str) -> tuple[BodyShape, ...]:
    members = several(shapes, name, error=SpecError)
    if wrong := [one for one in members if isinstance(one, type) or not isinstance(one, BodyShape)]:
        raise SpecError(f"{name} have {shown(wrong[0])}; they are such as Box((0.1, 0.1, 0.2), (0, 0, 0.1))")
    return members  # type: ignore[return-value]  # just checked


@brief
@dataclass(frozen=True, kw_only=True)
class Payload(Checked):
    """A rigid body fixed to a link; a point mass unless an inertia is given.

    Attributes:
        mass: [kg]; zero: it weighs nothing.
        com: centre of mass in `frame` [m], shape (3,); at a generated arm's tip x is along the last link. Kept as a
            tuple.
        inertia: about its centre of mass, along the axes of `frame` [kg m²]: Ixx, Iyy, Izz, these and Ixy, Ixz, Iyz,
            or the symmetric matrix. Kept as a tuple of three or six.
        frame: the link or other frame it is fixed to, any that moves; None: the tip.
        shapes: solids that it consists of, such as `Box`, placed in `frame`: they are kept clear of obstacles, and
            with `self_collision` of the links on other joints. None of them: it has no size.
        name: in messages and `allowed_contacts`.

    Raises:
        SpecError: not finite, of another shape, or no body has such an inertia.
    """

    mass: float = checked(number, name="payload mass", unit="kg", sign="not negative", error=SpecError)
    com: Sequence[float] | Array = checked(point, (0.0, 0.0, 0.0), name="payload com [m]", error=SpecError)
    inertia: ArrayLike = checked(_moments, (0.0, 0.0, 0.0), name="payload inertia")
    frame: str | None = checked(text, None, name="payload frame", error=SpecError)
    shapes: Sequence[BodyShape] = checked(_body_shapes, (), name="payload shapes")
    name: str = checked(text, "payload", name="payload name", error=SpecError)

    def __post_init__(self) -> None:
        super().__post_init__()
        a, b, c = np.linalg.eigvalsh(self.tensor)
        slack = 1e-9 * max(abs(a), abs(c))
        if a < -slack or a + b < c - slack:
            raise SpecError(f"payload inertia {self.inertia} kg m² is negative or breaks the triangle inequality")

    @property
    def tensor(self) -> Array:
        """The inertia as a matrix [kg m²], shape (3, 3)."""
        moments = np.zeros(6)
        moments[: np.size(self.inertia)] = self.inertia
        xx, yy, zz, xy, xz, yz = moments
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

    @classmethod
    def at_last_com(cls, spec: ArmSpec, mass: float) -> Payload:
        """Point mass at the last link's centre of mass.

        It is payload "mM" of Giv and Malek (2024), in one reading: m becomes m + M while l_c and I stay as they are.
        """
        last = expect(spec, ArmSpec, "spec", error=SpecError).links[-1]
        return Payload(mass=mass, com=(last.com - last.length, 0.0, 0.0))


def placed(placement: Placement, name: str) -> tuple[tuple[float, ...], ...]:
    """A placement of a robot's tip or base as rows of its matrix; raises a `SpecError`, see `pose_rows`."""
    with reraised(SpecError):
        return pose_rows(placement, name)


@brief
@dataclass(frozen=True, kw_only=True)
class Tool(Payload):
    """A rigid body that stays on the arm, with the arm's tip: a payload hangs there unless it names a frame.

    Attributes:
        mass: see `Payload`; so are com, inertia and shapes.
        frame: see `Payload`; None: the arm's own tip.
        name: in messages and `allowed_contacts`, and of the frame at its tip.
        tip: placement of the tip in `frame`: a position [m], shape (3,), or a pose, shape (4, 4) or `pin.SE3`. Kept as
            the rows of the matrix.

    Raises:
        SpecError: see `Payload`; or the tip is no placement.
    """

    name: str = checked(text, "tool", name="payload name", error=SpecError)
    tip: Placement = checked(placed)

    def _of_whom(self) -> str:
        return f" of tool {shown(self.name)}"
