"""The paper's equations (5) to (7) as printed, errors included: no mechanics, a record.

(5) and (6) are right. (7) is not: it puts l_c = L/2 in place of Table 1's centres of mass nearly
everywhere, its D is triangular (d21 = d31 = d32 = 0) with wrong coefficients in d11, d12, d13 and d23,
and its C is derived from that D. Use it only to test whether the paper's own numbers were computed
with, as the variant named "printed"; `closed_form` has the mechanics.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array
from armdyn.errors import SpecError
from armdyn.models.values.spec import GRAVITY, ArmSpec


@dataclass(frozen=True, kw_only=True)
class PrintedArm:
    """D(q) a + C(q, v) v + g(q) = tau as equation (5), (6) or (7) is printed.

    The product C v is that of the printed matrix with the vector of velocities, as in (28) to (30).

    Attributes:
        length: L_i of every link [m].
        com: l_ci of every link [m].
        mass: m_i of every link [kg]; the last one's with the payload.
        inertia_about_com: I_i of every link [kg m²].
    """

    length: tuple[float, ...]
    com: tuple[float, ...]
    mass: tuple[float, ...]
    inertia_about_com: tuple[float, ...]

    @classmethod
    def from_spec(cls, spec: ArmSpec, payload_mass: float = 0.0) -> Self:
        """The printed equations of an arm, the last mass being m + M and all else as it is.

        Args:
            spec: an arm of one, two or three links.
            payload_mass: M [kg].

        Raises:
            SpecError: more than three links, or a mass that is negative or not finite.
        """
        links = spec.links
        if len(links) > 3:
            raise SpecError(f"the paper prints equations for one to three links, not {len(links)}")
        if not (np.isfinite(payload_mass) and payload_mass >= 0):
            raise SpecError(f"payload mass is {payload_mass} kg; it must be finite and not negative")
        return cls(
            length=tuple(link.length for link in links),
            com=tuple(link.com for link in links),
            mass=(*(link.mass for link in links[:-1]), links[-1].mass + payload_mass),
            inertia_about_com=tuple(link.inertia for link in links),
        )

    @property
    def nv(self) -> int:
        """Number of joints."""
        return len(self.length)

    def inertia(self, q: ArrayLike) -> Array:
        """Mass matrix D(q) as printed [kg m²], shape (nv, nv); upper triangular for three links.

        Args:
            q: joint angles [rad], shape (nv,).
        """
        q = self._angles(q)
        if self.nv == 1:
            return self._inertia_5()
        return self._inertia_6(q) if self.nv == 2 else self._inertia_7(q)

    def coriolis(self, q: ArrayLike, v: ArrayLike) -> Array:
        """C(q, v) as printed [N m s], shape (nv, nv).

        Args:
            q: joint angles [rad], shape (nv,).
            v: joint velocities [rad/s], shape (nv,).
        """
        q, v = self._angles(q), self._angles(v)
        if self.nv == 1:
            return np.zeros((1, 1))
        return self._coriolis_6(q, v) if self.nv == 2 else self._coriolis_7(q, v)

    def gravity(self, q: ArrayLike) -> Array:
        """g(q) as printed [N m], shape (nv,).

        Args:
            q: joint angles [rad], shape (nv,).
        """
        q = self._angles(q)
        if self.nv == 1:
            return self._gravity_5(q)
        return self._gravity_6(q) if self.nv == 2 else self._gravity_7(q)

    def _angles(self, x: ArrayLike) -> Array:
        x = np.asarray(x, dtype=float)
        if x.shape != (self.nv,):
            raise SpecError(f"expected {self.nv} numbers, one per joint, got shape {x.shape}")
        return x

    # Equation (5)

    def _inertia_5(self) -> Array:
        (m1,), (lc1,), (I1,) = self.mass, self.com, self.inertia_about_com
        return np.array([[m1 * lc1**2 + I1]])

    def _gravity_5(self, q: Array) -> Array:
        (m1,), (lc1,) = self.mass, self.com
        return np.array([m1 * GRAVITY * lc1 * np.cos(q[0])])

    # Equation (6)

    def _inertia_6(self, q: Array) -> Array:
        (m1, m2), (L1, _), (lc1, lc2), (I1, I2) = self.mass, self.length, self.com, self.inertia_about_com
        c2 = np.cos(q[1])
        d11 = m1 * lc1**2 + m2 * (L1**2 + lc2**2 + 2 * L1 * lc2 * c2) + I1 + I2
        d12 = m2 * (lc2**2 + L1 * lc2 * c2) + I2
        d22 = m2 * lc2**2 + I2
        return np.array([[d11, d12], [d12, d22]])

    def _coriolis_6(self, q: Array, v: Array) -> Array:
        h = -self.mass[1] * self.length[0] * self.com[1] * np.sin(q[1])
        return np.array([[h * v[1], h * v[0] + h * v[1]], [-h * v[0], 0.0]])

    def _gravity_6(self, q: Array) -> Array:
        (m1, m2), (L1, _), (lc1, lc2) = self.mass, self.length, self.com
        g2 = m2 * GRAVITY * lc2 * np.cos(q[0] + q[1])
        return np.array([(m1 * lc1 + m2 * L1) * GRAVITY * np.cos(q[0]) + g2, g2])

    # Equation (7), term for term in the paper's order

    def _inertia_7(self, q: Array) -> Array:
        (m1, m2, m3), (L1, L2, L3), (lc1, lc2, _) = self.mass, self.length, self.com
        I1, I2, I3 = self.inertia_about_com
        c2, c3, c23 = np.cos(q[1]), np.cos(q[2]), np.cos(q[1] + q[2])
        d11 = (
            I1 + I2 + I3 + 1 / 4 * m1 * L1**2 + m2 * (lc1**2 + 1 / 4 * L2**2 + L1 * L2 * c2)
            + m3 * (L1**2 + L2**2 + 1 / 4 * L3**2 + 2 * L1 * L3 * c2 + L1 * L3 * c23 + L1 * L3 * c3)
        )  # fmt: skip
        d12 = (
            I2 + I3 + 1 / 2 * m2 * (1 / 2 * lc2**2 + L1 * L2 * c2)
            + m3 * (2 * L2**2 + 1 / 2 * L3**2 + 2 * L1 * L2 * c2 + L1 * L3 * c23 + 2 * L2 * L3 * c3)
        )  # fmt: skip
        d13 = I3 + 1 / 2 * (1 / 2 * L3**2 + L1 * L3 * c23 + L2 * L3 * c3)
        d22 = I2 + I3 + 1 / 4 * m2 * L2**2 + m3 * (L2**2 + 1 / 4 * L3**2 + L2 * L3 * c3)
        d23 = I3 + 1 / 2 * m3 * (L3**2 + L2 * L3 * c3)
        d33 = I3 + 1 / 4 * m3 * L3**2
        return np.array([[d11, d12, d13], [0.0, d22, d23], [0.0, 0.0, d33]])

    def _coriolis_7(self, q: Array, v: Array) -> Array:
        (_, m2, m3), (L1, L2, L3), (v1, v2, v3) = self.mass, self.length, v
        s2, s3, s23 = np.sin(q[1]), np.sin(q[2]), np.sin(q[1] + q[2])
        c12 = (
            -1 / 2 * m2 * L1 * L2 * s2 * (v1 + v2 + 1 / 2 * v3)
            - m3 * L1 * s2 * (L3 * v1 + L2 * (2 * v2 + v3))
            - m3 * L1 * L3 * s23 * (1 / 2 * v1 + v2 + 1 / 2 * v3)
            - 1 / 4 * L1 * L3 * s23 * v3
        )  # fmt: skip
        c13 = L3 * s3 * (-1 / 2 * L2 * (1 / 2 * v2 + v3) - 1 / 2 * m3 * L1 * v1 - 3 / 4 * m3 * L2 * v2)
        c22 = 1 / 2 * v1 * (L1 * L2 * s2 * (1 / 2 * m2 + 2 * m3) + m3 * L1 * L3 * s23)
        c23 = L2 * L3 * s3 * (-1 / 2 * m3 * (1 / 2 * v1 + v2 + v3) + 1 / 4 * v1)
        c33 = 1 / 4 * L2 * L3 * s3 * (v1 - m3 * v2)
        return np.array([[0.0, c12, c13], [0.0, c22, c23], [0.0, c22, c33]])  # c32 = c22 in the paper

    def _gravity_7(self, q: Array) -> Array:
        (m1, m2, m3), (L1, L2, L3), g = self.mass, self.length, GRAVITY
        c1, c12, c123 = np.cos(np.cumsum(q))
        g1 = (
            1 / 2 * m1 * g * L1 * c1
            + m2 * g * (L1 * c1 + 1 / 2 * L2 * c12)
            + m3 * g * (L1 * c1 + L2 * c12 + 1 / 2 * L3 * c123)
        )  # fmt: skip
        g2 = 1 / 2 * m2 * g * L2 * c12 + m3 * g * (L2 * c12 + 1 / 2 * L3 * c123)
        g3 = 1 / 2 * m3 * g * L3 * c123
        return np.array([g1, g2, g3])
