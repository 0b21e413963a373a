"""The equations of motion of planar R, RR and RRR arms, derived by hand.

With phi_i = q_1 + … + q_i the angle of link i to the horizontal, the centres of mass are at

    p_1 = l_1 u(phi_1),
    p_2 = L_1 u(phi_1) + l_2 u(phi_2),
    p_3 = L_1 u(phi_1) + L_2 u(phi_2) + l_3 u(phi_3),

u(phi) = (cos phi, sin phi), so that the Lagrangian is

    T - P = sum_i ½ m_i |dp_i/dt|² + ½ I_i (dphi_i/dt)² - m_i g (p_i)_vertical.

T = ½ vᵀ D(q) v gives D, its derivatives the Christoffel symbols of the paper's equation (3), and
dP/dq gravity. All couplings hang on three products, on which the formulas below are written:

    a = (m_2 l_2 + m_3 L_2) L_1,   b = m_3 L_1 l_3,   e = m_3 L_2 l_3.

An arm of fewer links is the leading block of one whose further links weigh nothing. Nothing here is
differentiated by machine: these are an independent check on Pinocchio, and it on them.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array
from armdyn.errors import SpecError
from armdyn.models.values.spec import GRAVITY, ArmSpec, LinkSpec, Payload
from armdyn.models.values.urdf import TIP

_Triple = tuple[float, float, float]
MOST_LINKS = 3


@dataclass(frozen=True, kw_only=True)
class PlanarArm:
    """D(q) a + C(q, v) v + g(q) = tau of a planar arm of one, two or three links.

    Angles are relative; zero is stretched out horizontally; positive turns up, against gravity.

    Attributes:
        length: joint to next joint, or to the tip, of every link [m].
        com: joint to centre of mass of every link [m].
        mass: of every link [kg].
        inertia_about_com: of every link, around the joint's axis [kg m²].
    """

    length: tuple[float, ...]
    com: tuple[float, ...]
    mass: tuple[float, ...]
    inertia_about_com: tuple[float, ...]

    def __post_init__(self) -> None:
        numbers = vars(self).values()
        if len({len(x) for x in numbers}) != 1 or not 1 <= self.nv <= MOST_LINKS:
            raise SpecError(f"the hand-derived equations are for one to {MOST_LINKS} links, not {self.nv}")

    @classmethod
    def from_spec(cls, spec: ArmSpec, payload: Payload | None = None) -> Self:
        """The arm with its payload made part of the last link.

        Raises:
            SpecError: more than three links, or a payload elsewhere than at the tip on the link's axis.
        """
        links = spec.links
        if payload is not None:
            links = (*links[:-1], loaded(links[-1], payload))
        return cls(
            length=tuple(link.length for link in links),
            com=tuple(link.com for link in links),
            mass=tuple(link.mass for link in links),
            inertia_about_com=tuple(link.inertia for link in links),
        )

    @property
    def nv(self) -> int:
        """Number of joints."""
        return len(self.length)

    def inertia(self, q: ArrayLike) -> Array:
        """Joint-space inertia D(q) [kg m²], shape (nv, nv).

        Args:
            q: joint angles [rad], shape (nv,).
        """
        (_, q2, q3), m, (L1, L2, _) = self._padded(q), self._three(self.mass), self._three(self.length)
        I, l = self._three(self.inertia_about_com), self._three(self.com)  # noqa: E741
        a, b, e = self._couplings()
        A, B, E = a * np.cos(q2), b * np.cos(q2 + q3), e * np.cos(q3)
        d33 = I[2] + m[2] * l[2] ** 2
        d22 = I[1] + m[1] * l[1] ** 2 + m[2] * L2**2 + 2 * E + d33
        d11 = I[0] + m[0] * l[0] ** 2 + (m[1] + m[2]) * L1**2 + 2 * (A + B) + d22
        d23 = d33 + E
        d13 = d23 + B
        d12 = d22 + A + B
        D = np.array([[d11, d12, d13], [d12, d22, d23], [d13, d23, d33]])
        return D[: self.nv, : self.nv]

    def coriolis(self, q: ArrayLike, v: ArrayLike) -> Array:
        """Christoffel matrix C(q, v) [N m s], shape (nv, nv), by which dD/dt - 2 C is skew.

        Args:
            q: joint angles [rad], shape (nv,).
            v: joint velocities [rad/s], shape (nv,).
        """
        (_, q2, q3), (v1, v2, v3) = self._padded(q), self._padded(v)
        a, b, e = self._couplings()
        A, B, E = a * np.sin(q2), b * np.sin(q2 + q3), e * np.sin(q3)
        C = np.array(
            [
                [
                    -(A + B) * v2 - (B + E) * v3,
                    -(A + B) * (v1 + v2) - (B + E) * v3,
                    -(B + E) * (v1 + v2 + v3),
                ],
                [(A + B) * v1 - E * v3, -E * v3, -E * (v1 + v2 + v3)],
                [(B + E) * v1 + E * v2, E * (v1 + v2), 0 * v1],
            ]
        )
        return C[: self.nv, : self.nv]

    def gravity(self, q: ArrayLike) -> Array:
        """Gravity torque g(q) [N m], shape (nv,): it holds the arm still.

        Args:
            q: joint angles [rad], shape (nv,).
        """
        m1, m2, m3 = self._three(self.mass)
        (l1, l2, l3), (L1, L2, _) = self._three(self.com), self._three(self.length)
        phi1, phi2, phi3 = np.cumsum(self._padded(q))
        g3 = m3 * l3 * np.cos(phi3)
        g2 = (m2 * l2 + m3 * L2) * np.cos(phi2) + g3
        g1 = (m1 * l1 + (m2 + m3) * L1) * np.cos(phi1) + g2
        return GRAVITY * np.array([g1, g2, g3])[: self.nv]

    def _couplings(self) -> _Triple:
        _, m2, m3 = self._three(self.mass)
        (_, l2, l3), (L1, L2, _) = self._three(self.com), self._three(self.length)
        return (m2 * l2 + m3 * L2) * L1, m3 * L1 * l3, m3 * L2 * l3

    def _three(self, x: tuple[float, ...]) -> _Triple:
        """Pad numbers per link to three links with zeros."""
        first, second, third = (*x, 0.0, 0.0)[:MOST_LINKS]
        return first, second, third

    def _padded(self, x: ArrayLike) -> Array:
        """Joint angles or velocities of three joints; complex ones stay complex."""
        x = np.asarray(x)
        if x.shape != (self.nv,):
            raise SpecError(f"expected {self.nv} numbers, one per joint, got shape {x.shape}")
        return np.concatenate((x, np.zeros(MOST_LINKS - self.nv)))


def loaded(link: LinkSpec, payload: Payload) -> LinkSpec:
    """A link and the payload at its tip as one body, by the parallel-axis theorem.

    Raises:
        SpecError: the payload is not on the link's axis or fixed elsewhere than to the tip.
    """
    if payload.frame not in (None, TIP):
        raise SpecError(f"the hand-derived equations carry a payload at {TIP!r}, not {payload.frame!r}")
    along, *across = payload.com
    if any(across):
        raise SpecError(f"payload com {payload.com} m is not on the last link's axis (x)")
    at = link.length + along
    mass = link.mass + payload.mass
    com = (link.mass * link.com + payload.mass * at) / mass
    own = link.inertia + (payload.tensor[1, 1] if payload.mass > 0 else 0.0)  # iyy: around the joints' axis
    inertia = own + link.mass * (com - link.com) ** 2 + payload.mass * (at - com) ** 2
    return LinkSpec(length=link.length, com=com, mass=mass, inertia=inertia)
