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
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armdyn.models.values.friction import JointFriction
from armdyn.optimal.bound.enclosure.interval import Interval, rounding
from armdyn.optimal.bound.terms import Indices, Terms

Array = NDArray[np.float64]

MOST_CORNERS = 9
"""Joints up to which all 2ⁿ corners are tried; beyond, every product counts with its greatest size."""

_LEAST = 1e-300
"""Squares that bend a chord by less count for nothing, as what underflows does [the unit of the rate]."""


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
        exact = Interval.at(np.broadcast_to(w, (boxes, nv, w.shape[-1])))
        linear = -Interval.at(damping[:, None]) * exact
        turning = Interval.at(np.zeros((1, nv, 1, 1)))
        if way is not None:
            linear = linear + way
        if steps is not None:
            steps = steps.spread((boxes, *steps.lower.shape[-2:]))
            linear = linear + self.terms.inertia.dot(steps)
            turning = self.terms.inertia_slopes.dot(steps[:, None])
        constant = self.torque - self.terms.gravity - self._tanh * Interval.at(coulomb)
        weight = self.terms.gravity_slopes.dot(exact)
        return self._form(linear, self._squares(w), turning, -weight) + constant[:, None].dot(exact)[:, 0]

    @cached_property
    def _tanh(self) -> Interval:
        return (self.v / Interval.at(self.friction.width)).tanh()

    def _squares(self, w: Array) -> Interval:
        """Coefficients of v_a v_b, a ≥ b, in ½ vᵀ (Σ w_k ∂M/∂q_k) v, shape (boxes, pairs, m)."""
        rows, columns = self._pairs
        return self.terms.bends.times(w) * Interval.at(np.where(rows == columns, 0.5, 1.0)[:, None])

    @property
    def _pairs(self) -> tuple[Indices, Indices]:
        return np.tril_indices(self.v.lower.shape[1])

    @cached_property
    def _corners(self) -> Array:
        """Corners of the boxes of velocities, shape (boxes, corners, nv); one alone, at rest, if there are too many."""
        boxes, nv = self.v.lower.shape
        if nv > MOST_CORNERS:
            return np.zeros((boxes, 1, nv))
        upper = np.array(list(product((False, True), repeat=nv)))
        return np.where(upper, self.v.upper[:, None], self.v.lower[:, None])

    def _form(self, linear: Interval, squares: Interval, turning: Interval, weight: Interval) -> Interval:
        """The range of linearᵀ v + Σ squares_ab v_a v_b + Σ_k ε_k (turning_k v + weight_k), shape (boxes, m).

        Args:
            linear: shape (boxes, nv, m).
            squares: shape (boxes, pairs, m).
            turning: shape (boxes, nv, nv, m), or with 1 for boxes, the second nv and m.
            weight: shape (boxes, nv, m).
        """
        boxes, nv, many = weight.lower.shape
        rows, columns = self._pairs
        v, most = self._corners, self.v.magnitude[:, None]
        pairs, most_pairs = (x[..., rows] * x[..., columns] for x in (v, most))
        tried = 1.0 if nv <= MOST_CORNERS else 0.0
        parts = [(linear, most), (squares, most_pairs), (weight, np.ones((1, 1, nv)))]
        turned = turning.spread((boxes, nv, nv, many)).turned((0, 1, 2, 3)).shaped((boxes, nv * nv, many))
        parts.append((turned, np.tile(most, nv)))
        beside = np.zeros((boxes, 1, many))
        for x, size in parts:
            beside += size @ (x.radius + (1 - tried) * np.abs(x.centre))
            beside += rounding(4 * nv * nv + 2 * len(rows) + 16 * nv, size @ x.magnitude)
        own = rows == columns
        slopes = v @ turning.spread((boxes, nv, nv, many)).centre.transpose(0, 2, 1, 3).reshape(boxes, nv, nv * many)
        slopes = tried * slopes.reshape(boxes, -1, nv, many) + weight.centre[:, None]
        beside_q = np.sum(np.abs(slopes), axis=2)
        ends = []
        for sign in (-1.0, 1.0):
            square = sign * tried * squares.centre
            concave = np.maximum(-square[:, own], 0.0)
            square[:, own] = np.maximum(square[:, own], 0.0)
            reached = v @ (sign * tried * linear.centre) + pairs @ square + beside_q
            ends.append(sign * (self._greatest(reached, concave) + beside[:, 0]))
        return Interval(ends[0], ends[1])

    def _greatest(self, corners: Array, concave: Array) -> Array:
        """Maximum over a box's velocities of a function convex in each one, less Σ concave_a v_a², shape (boxes, m).

        A chord less c v² is greatest at an end or where 2 c v is the chord's slope. An error δ of that place costs
        c δ², of second order in the unit roundoff: what counts is the rounding of some 16 operations a joint.

        Args:
            corners: the function's values at the corners of the velocities' box, shape (boxes, corners, m).
            concave: not negative, shape (boxes, nv, m).
        """
        if self.v.lower.shape[1] > MOST_CORNERS:
            return corners[:, 0]
        for joint in range(concave.shape[1]):
            first, last = np.split(corners, 2, axis=1)
            lower, upper = (end[:, joint, None, None] for end in (self.v.lower, self.v.upper))
            c, wide, rise = concave[:, None, joint], upper - lower, last - first
            bend = 2 * c * wide**2
            share = np.clip(rise - 2 * c * wide * lower, 0.0, bend) / np.maximum(bend, _LEAST)
            between = first + share * rise - c * (lower + share * wide) ** 2
            corners = np.maximum(between, np.maximum(first - c * lower**2, last - c * upper**2))
        return corners[:, 0]
