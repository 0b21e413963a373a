"""Unknowns of an identification: torque = known + regressor · unknowns, and the divergence from the prior.

All unknowns are relative to a prior value and zero there. The pseudo-inertia of a body is L (1 + S) Lᵀ with L Lᵀ the
prior's (Wensing, Kim, Slotine, IEEE RA-L 3(1), 2018), S symmetric with ten entries; armature, viscous and Coulomb
friction are scale · (1 + x); an offset is scale · x. The divergence is the entropic one, tr S − log det(1 + S) of a
body (Lee, Wensing, Park, IEEE T-RO 36(1), 2020), x − log(1 + x) of a positive number, x²/2 of an offset: infinite where
an inertia stops being one, and the same in every unit and frame.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from scipy.linalg import block_diag

from armdyn.arrays import Array

LEAST_RADIUS = 2e-3
"""Least radius of gyration of a prior's body [m]: a point mass could not be fitted by any other body."""


BASIS, (_ROWS, _COLUMNS) = np.zeros((10, 4, 4)), np.tril_indices(4)
"""Orthonormal basis of the symmetric 4 × 4 matrices."""
BASIS[range(10), _ROWS, _COLUMNS] = BASIS[range(10), _COLUMNS, _ROWS] = np.where(_ROWS == _COLUMNS, 1.0, np.sqrt(0.5))
_TRACES = np.trace(BASIS, axis1=1, axis2=2)
_IDENTITY = np.eye(4).ravel()


def parameters_of(pseudo: Array) -> Array:
    """Pinocchio's dynamic parameters, shape (…, 10), of pseudo-inertias, shape (…, 4, 4)."""
    spread, first, mass = pseudo[..., :3, :3], pseudo[..., :3, 3], pseudo[..., 3, 3]
    tensor = np.trace(spread, axis1=-2, axis2=-1)[..., None, None] * np.eye(3) - spread
    rows, columns = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
    return np.concatenate([mass[..., None], first, tensor[..., rows, columns]], axis=-1)


def prior_factor(inertia: pin.Inertia) -> Array:
    """L of the prior L Lᵀ of a body, shape (4, 4); a body without extent gets some, see `LEAST_RADIUS`."""
    mass, at = max(float(inertia.mass), 1e-3), np.eye(4)
    at[:3, 3] = inertia.lever
    tensor = np.array(inertia.inertia)
    values, axes = np.linalg.eigh(np.trace(tensor) / 2 * np.eye(3) - tensor)
    spread = np.zeros((4, 4))
    spread[:3, :3] = axes @ np.diag(np.sqrt(np.maximum(values, mass * LEAST_RADIUS**2)))
    spread[3, 3] = np.sqrt(mass)
    return at @ spread


class Ray(NamedTuple):
    """The divergence from some unknowns x to x + length · step."""

    linear: float
    """Slope but for the logarithms."""
    quadratic: float
    """Curvature of the offsets."""
    rates: Array
    """Relative changes of eigenvalues and positive numbers with the length, shape (4 bodies + positive,)."""

    @property
    def border(self) -> float:
        """Length at which a body stops being physical, or a positive number positive."""
        least = float(np.min(self.rates, initial=0.0))
        return -1 / least if least < 0 else float(np.inf)

    def slope(self, length: float) -> float:
        """Derivative of the divergence by the length."""
        return float(self.linear + length * self.quadratic - np.sum(self.rates / (1 + length * self.rates)))


class Divergence(NamedTuple):
    """The divergence from the prior near some unknowns x."""

    gradient: Array
    """Shape (p,)."""
    hessian: Array
    """Shape (p, p)."""
    turned: Array
    """C⁻¹ B C⁻ᵀ of each symmetric B of the basis, where C Cᵀ is 1 + S of a body, shape (bodies, 10, 16)."""
    positive: Array
    """Positive numbers, relative to the prior's."""
    free: Array
    """Offsets, relative to their scales."""

    def along(self, step: Array) -> Ray:
        """The divergence along a step, without differences of its values."""
        split = 10 * len(self.turned)
        own, positive, free = step[:split].reshape(-1, 1, 10), *np.split(step[split:], [self.positive.size])
        turned = np.linalg.eigvalsh((own @ self.turned).reshape(-1, 4, 4)).ravel()
        linear = (own @ _TRACES).sum() + positive.sum() + self.free @ free
        return Ray(float(linear), float(free @ free), np.concatenate([turned, positive / self.positive]))


@dataclass(frozen=True)
class Unknowns:
    """Layout of the unknowns: bodies, then positive numbers, then offsets.

    Attributes:
        joints: of each body: the index of the joint that moves it, from 0.
        factors: L of each body in the frame of its joint, shape (bodies, 4, 4).
        armature: scales of the joints' reflected rotor inertias [kg m² or kg], shape (nv,) or (0,).
        damping: likewise of viscous friction [N m s/rad or N s/m], shape (nv,).
        coulomb: of Coulomb friction [N m or N], shape (nv,).
        offset: of the torque sensors' offsets [N m or N], shape (nv,).
    """

    joints: tuple[int, ...]
    factors: Array
    armature: Array
    damping: Array
    coulomb: Array
    offset: Array

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return 10 * len(self.joints) + self.positive + self.offset.size

    @property
    def positive(self) -> int:
        """Number of the positive numbers."""
        return self.armature.size + self.damping.size + self.coulomb.size

    def basis(self) -> Array:
        """Change of each body's dynamic parameters with its unknowns, shape (bodies, 10, 10)."""
        moved = np.einsum("bij,kjl,bml->bkim", self.factors, BASIS, self.factors)
        return np.swapaxes(parameters_of(moved), 1, 2)

    @property
    def scales(self) -> Array:
        """Scales of the numbers after the bodies, shape (p − 10 bodies,)."""
        return np.concatenate([self.armature, self.damping, self.coulomb, self.offset])

    def in_units_of(self, other: "Unknowns") -> Array:
        """Matrix that turns these unknowns into those of another unit, shape (p, p)."""
        blocks = np.linalg.solve(other.basis(), self.basis())
        return np.asarray(block_diag(*blocks, np.diag(self.scales / other.scales)))

    def bodies(self, x: Array) -> Array:
        """Pseudo-inertias of the bodies, shape (bodies, 4, 4)."""
        return np.asarray(self.factors @ self._relative(x) @ np.swapaxes(self.factors, 1, 2))

    def numbers(self, x: Array) -> tuple[Array, Array, Array, Array]:
        """Armature (or nothing), damping, Coulomb friction and offset at the unknowns x."""
        relative = x[10 * len(self.joints) :] + (np.arange(self.scales.size) < self.positive)
        ends = np.cumsum([self.armature.size, self.damping.size, self.coulomb.size])
        armature, damping, coulomb, offset = np.split(relative * self.scales, ends)
        return armature, damping, coulomb, offset

    def _relative(self, x: Array) -> Array:
        own = x[: 10 * len(self.joints)].reshape(-1, 10)
        return np.asarray((_IDENTITY + own @ BASIS.reshape(10, 16)).reshape(-1, 4, 4))

    def divergence_near(self, x: Array) -> Divergence:
        """The divergence from the prior near physical unknowns, shape (p,)."""
        split, size = 10 * len(self.joints), x.size
        offsets = split + self.positive
        inverse = np.linalg.inv(np.linalg.cholesky(self._relative(x)))[:, None]
        turned = (inverse @ BASIS @ inverse.swapaxes(2, 3)).reshape(-1, 10, 16)
        positive, free = 1 + x[split:offsets], x[offsets:]
        slopes = _TRACES - turned @ _IDENTITY
        gradient = np.concatenate([slopes.ravel(), 1 - 1 / positive, free])
        hessian = np.zeros((size, size))
        diagonal = hessian.ravel()[:: size + 1]  # written in place: `block_diag` costs more than all the rest
        diagonal[split:offsets], diagonal[offsets:] = positive**-2, 1.0
        for k, block in enumerate(turned @ turned.swapaxes(1, 2)):
            hessian[10 * k : 10 * k + 10, 10 * k : 10 * k + 10] = block
        return Divergence(gradient, hessian, turned, positive, free)
