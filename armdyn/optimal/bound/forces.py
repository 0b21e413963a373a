"""Enclosure of the rate of momentum over boxes of positions and velocities.

With generalized momentum p = M(q) v the equations of motion are, by Lagrange,

    dp/dt = τ + e(q, v),   e = ½ vᵀ (∂M/∂q) v − g(q) − τ_f(v),

τ_f the joints' friction. For multipliers w, their slopes ẇ and λ what is sought is the range of

    λᵀ v + ẇᵀ M(q) v + wᵀ (τ + e(q, v)).

In q it is linear about the box's centre, with slopes that are intervals but narrow ones; for given v its extremes
over q are hence Σ |slope| radius, a convex function of v. In v it is a quadratic form. All of it but the concave
squares is convex in each joint's velocity, the others given: between that joint's extremes it is nowhere above its
chord, and the greatest value of chord and concave square together has a formula. As a greatest value of convex
functions it is convex in the next joint's velocity; so the values at all corners of the velocity box, which are
computed at once, are combined joint by joint. The intervals' radii count by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.locks import cached_property
from armdyn.models.values.friction import JointFriction
from armdyn.optimal.bound.enclosure.interval import Interval
from armdyn.optimal.bound.terms import Indices, Terms

MOST_CORNERS = 9
"""Joints up to which all 2ⁿ corners are tried; beyond, every product counts with its greatest size."""


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces over boxes.

    Attributes:
        terms: inertia and gravity over the boxes of positions.
        v: velocities [rad/s or m/s], shape (boxes, nv).
        torque: [N m or N], shape (boxes, nv).
        friction: in the joints.
    """

    terms: Terms
    v: Interval
    torque: Interval
    friction: JointFriction

    def __getitem__(self, boxes: slice | Indices) -> Forces:
        return Forces(self.terms[boxes], self.v[boxes], self.torque[boxes], self.friction)

    def rate(self, w: Array, way: Interval | None = None, steps: Interval | None = None) -> Interval:
        """Enclosure of λᵀ v + ẇᵀ M(q) v + wᵀ (τ + e(q, v)), shape (boxes, m).

        Args:
            w: multipliers, shape (nv, m) or (boxes, nv, m).
            way: λ, shape (nv, m) or (boxes, nv, m); None: zero.
            steps: ẇ, likewise.
        """
        boxes, nv = self.v.lower.shape
        damping, coulomb = self.friction.per_joint(nv)
        shape, turning = (boxes, nv, w.shape[-1]), None
        linear = (-Interval.at(damping[:, None]) * Interval.at(w)).spread(shape)
        if way is not None:
            linear = linear + way
        if steps is not None:
            steps = steps.spread(shape)
            linear = linear + self.terms.inertia.dot(steps)
            turning = self.terms.inertia_slopes.dot(steps[:, None]).spread((boxes, nv, *shape[1:]))
        constant = self.torque - self.terms.gravity - self._tanh * Interval.at(coulomb)
        weight = self.terms.gravity_slopes.times(w)
        found = range_of(self.v, linear, self._squares(w), turning, -weight)
        return found + constant[:, None].times(w)[:, 0]

    @cached_property
    def _tanh(self) -> Interval:
        return (self.v / Interval.at(self.friction.width)).tanh()

    def _squares(self, w: Array) -> Interval:
        """Coefficients of v_a v_b, a ≥ b, in ½ vᵀ (Σ w_k ∂M/∂q_k) v, shape (boxes, pairs, m)."""
        rows, columns = np.tril_indices(self.v.lower.shape[1])
        sums, part = self.terms.bends.times(w), np.where(rows == columns, 0.5, 1.0)[:, None]
        return Interval(sums.lower * part, sums.upper * part)  # exact


def range_of(v: Interval, linear: Interval, squares: Interval, turning: Interval | None, weight: Interval) -> Interval:
    """The range of linearᵀ v + Σ squares_ab v_a v_b + Σ_k ε_k (turning_kᵀ v + weight_k) over |ε_k| ≤ 1, (boxes, m).

    Args:
        v: boxes of velocities, shape (boxes, nv).
        linear: shape (boxes, nv, m).
        squares: a ≥ b, row by row, shape (boxes, pairs, m).
        turning: by k, then by v, shape (boxes, nv, nv, m); None: zero.
        weight: shape (boxes, nv, m).
    """
    import _armdyn_enclosure as enclosure

    corners, many = v.lower.shape[1] <= MOST_CORNERS, weight.lower.shape[-1]
    tables = (
        None if each is None else (_whole(each.lower), _whole(each.upper))
        for each in (linear, squares, turning, weight)
    )
    return Interval(*enclosure.range_of(_whole(v.lower), _whole(v.upper), many, *tables, corners))


def _whole(table: Array) -> Array:
    return np.ascontiguousarray(table)
