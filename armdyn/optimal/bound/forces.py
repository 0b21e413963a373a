"""How fast momentum may change over boxes of positions and velocities.

With generalized momentum p = M(q) v the equations of motion are, by Lagrange,

    dp/dt = τ + e(q, v),   e = ½ vᵀ (∂M/∂q) v − g(q) − τ_f(v),

τ_f the joints' friction. For fixed multipliers w the rate wᵀ dp/dt is a quadratic form in v. Its products of
different joints are greatest at a corner of the velocity box, which are all tried at once with the squares that are
convex and with all that is linear; concave squares are greatest in between and count by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armdyn.models.friction import JointFriction
from armdyn.models.limits import JointLimits
from armdyn.optimal.bound.interval import Interval, rounding
from armdyn.optimal.bound.terms import Terms, pairs

Array = NDArray[np.float64]

MOST_CORNERS = 9
"""Joints up to which all 2ⁿ corners are tried; beyond, every product counts with its greatest size."""


@dataclass(frozen=True, eq=False)
class Forces:
    """What acts within boxes.

    Attributes:
        terms: inertia, its slopes and gravity over the boxes.
        v: velocities [rad/s or m/s], shape (boxes, nv).
        limits: of torque.
        friction: in the joints.
    """

    terms: Terms
    v: Interval
    limits: JointLimits
    friction: JointFriction

    def rate(self, w: Array, pull: Interval) -> Interval:
        """What wᵀ(τ + e(q, v)) + pullᵀ v may be, shape (boxes, m).

        Args:
            w: multipliers, shape (nv, m) or (boxes, nv, m).
            pull: shape (boxes, nv, m), or (1, nv, m) for all boxes.
        """
        nv = self.v.lower.shape[1]
        rows, columns = pairs(nv)
        damping, coulomb = self.friction.per_joint(nv)
        halves = np.where(rows == columns, 0.5, 1.0)[:, None]
        squares = self.terms.slopes.times(w) * Interval.at(halves)
        linear = pull - Interval.at(damping[:, None]) * Interval.at(w)
        lost = self.terms.gravity + self._tanh * Interval.at(coulomb)
        torque = Interval(self.limits.effort_lower, self.limits.effort_upper)
        constant = (torque - lost)[:, None].times(w)[:, 0]
        return self._form(linear, squares) + constant

    @cached_property
    def _tanh(self) -> Interval:
        return (self.v / Interval.at(self.friction.width)).tanh()

    @cached_property
    def _monomials(self) -> tuple[Array, Array]:
        """v and its products in the order of `pairs`, at the corners and at most: (boxes, corners, n), (boxes, n)."""
        nv = self.v.lower.shape[1]
        rows, columns = pairs(nv)
        upper = np.array(list(product((False, True), repeat=min(nv, MOST_CORNERS))))
        if nv > MOST_CORNERS:
            corners = np.zeros((len(self.v.lower), 1, nv))
        else:
            corners = np.where(upper, self.v.upper[:, None], self.v.lower[:, None])
        most = self.v.magnitude
        return tuple(  # type: ignore[return-value]  # two of them
            np.concatenate([x, x[..., rows] * x[..., columns]], axis=-1) for x in (corners, most)
        )

    def _form(self, linear: Interval, squares: Interval) -> Interval:
        """What linearᵀ v + Σ squares_cd v_c v_d may be, shape (boxes, m)."""
        nv = self.v.lower.shape[1]
        boxes, _, many = squares.lower.shape
        rows, columns = pairs(nv)
        corners, most = self._monomials
        lower, upper = (
            np.concatenate([np.broadcast_to(x, (boxes, nv, many)), y], axis=1)
            for x, y in ((linear.lower, squares.lower), (linear.upper, squares.upper))
        )
        centre = lower / 2 + upper / 2 if nv <= MOST_CORNERS else np.zeros_like(lower)
        size = np.maximum(np.abs(lower), np.abs(upper))
        radius = np.maximum(upper - centre, centre - lower)
        beside = np.einsum("bi,bim->bm", most, radius) + rounding(
            2 * len(rows) + nv, np.einsum("bi,bim->bm", most, size)
        )
        own = nv + np.flatnonzero(rows == columns)
        least_square = self.v.mignitude**2
        ends = []
        for sign in (-1.0, 1.0):
            turned = sign * centre
            concave = np.minimum(turned[:, own], 0.0)
            turned[:, own] = np.maximum(turned[:, own], 0.0)
            between = np.einsum("bi,bim->bm", least_square, concave)
            ends.append(sign * (np.max(corners @ turned, axis=1) + between + beside))
        return Interval(ends[0], ends[1])
