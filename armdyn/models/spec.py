"""Planar arms and their payload, as numbers."""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from armdyn.errors import SpecError

GRAVITY = 9.81
"""Magnitude of gravity [m/s²], along -z of the world, in the plane of a generated arm."""


@dataclass(frozen=True, kw_only=True)
class LinkSpec:
    """One link of a planar arm.

    Attributes:
        length: joint to next joint, or to the tip [m].
        com: joint to centre of mass, along the link [m].
        mass: [kg].
        inertia: about the centre of mass, around the joint's axis [kg m²].
    """

    length: float
    com: float
    mass: float
    inertia: float

    def __post_init__(self) -> None:
        for field, unit in (("length", "m"), ("mass", "kg"), ("inertia", "kg m²")):
            value = getattr(self, field)
            if not (np.isfinite(value) and value > 0):
                raise SpecError(f"{field} of a link is {value} {unit}; it must be positive and finite")
        if not np.isfinite(self.com):
            raise SpecError(f"com of a link is {self.com} m; it must be finite")


PAPER_LINKS = (
    LinkSpec(length=0.250, com=0.198, mass=0.193, inertia=1.15e-3),
    LinkSpec(length=0.234, com=0.143, mass=0.115, inertia=4.99e-4),
    LinkSpec(length=0.218, com=0.109, mass=0.100, inertia=6.58e-4),
)
"""Table 1 of the paper."""

PAPER_PAYLOADS = (0.0212, 0.0312, 0.0518, 0.1006, 0.1219, 0.1307, 0.1505, 0.2, 0.5, 1.0)
"""Table 2 of the paper [kg]."""

PaperArm = Literal["r", "rr", "rrr"]
PAPER_ARMS: tuple[PaperArm, ...] = ("r", "rr", "rrr")


@dataclass(frozen=True, kw_only=True)
class ArmSpec:
    """A planar arm of revolute joints: R, RR, RRR and so on.

    Joint angles are relative; all zero is the arm stretched out horizontally; positive turns up,
    against gravity.

    Attributes:
        name: the robot's name in the URDF.
        links: base to tip.
        position_limit: every joint stays within ± this [rad].
        velocity_limit: every joint stays within ± this [rad/s]. The paper has none; a URDF needs one.
        effort_limit: every torque stays within ± this [N m].
    """

    name: str
    links: tuple[LinkSpec, ...]
    position_limit: float = float(np.pi)
    velocity_limit: float = 1000.0
    effort_limit: float = 3.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "links", tuple(self.links))
        if not self.links:
            raise SpecError("an arm needs at least one link")
        for field, unit in (("position_limit", "rad"), ("velocity_limit", "rad/s"), ("effort_limit", "N m")):
            value = getattr(self, field)
            if not (np.isfinite(value) and value > 0):
                raise SpecError(f"{field} is {value} {unit}; it must be positive and finite")

    @classmethod
    def paper(cls, arm: PaperArm) -> Self:
        """The arm of the paper's Table 1 with one, two or three links.

        Raises:
            SpecError: `arm` is none of "r", "rr", "rrr".
        """
        if arm not in PAPER_ARMS:
            raise SpecError(f"the paper has no arm {arm!r}; it has {', '.join(PAPER_ARMS)}")
        return cls(name=arm, links=PAPER_LINKS[: len(arm)])


@dataclass(frozen=True, kw_only=True)
class Payload:
    """A rigid body at the tip of an arm; a point mass unless an inertia is given.

    Attributes:
        mass: [kg]; zero is no payload.
        offset: centre of mass in the tip's frame [m], x along the last link.
        inertia: about its centre of mass [kg m²]: (ixx, iyy, izz).
        frame: the frame it is fixed to; None: the tip.
    """

    mass: float
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)
    frame: str | None = None

    def __post_init__(self) -> None:
        if not (np.isfinite(self.mass) and self.mass >= 0):
            raise SpecError(f"payload mass is {self.mass} kg; it must be finite and not negative")
        for field, unit in (("offset", "m"), ("inertia", "kg m²")):
            value = tuple(map(float, getattr(self, field)))
            object.__setattr__(self, field, value)
            if len(value) != 3 or not np.all(np.isfinite(value)):
                raise SpecError(f"payload {field} is {value} {unit}; it must be three finite numbers")
        a, b, c = sorted(self.inertia)
        if a < 0 or a + b < c * (1 - 1e-9):
            raise SpecError(f"payload inertia {self.inertia} kg m² is negative or breaks the triangle inequality")

    @classmethod
    def at_last_com(cls, spec: ArmSpec, mass: float) -> Self:
        """The paper's other reading, "mM": m becomes m + M while l_c and I stay as they are.

        That is a point mass at the last link's centre of mass.
        """
        last = spec.links[-1]
        return cls(mass=mass, offset=(last.com - last.length, 0.0, 0.0))
