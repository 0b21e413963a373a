"""Enclosure of the rate of momentum over boxes of positions and velocities, also within torque-speed curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.locks import cached_property
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.models.values.friction import JointFriction
from armdyn.optimal.bound.enclosure import Indices, Terms
from armdyn.optimal.bound.interval import Interval, down, up

MOST_CORNERS = 9
"""Largest number of joints for which all 2ⁿ corners are evaluated; beyond, every product has its largest size."""


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces over boxes of positions and velocities.

    Attributes:
        terms: inertia and gravity over the boxes of positions.
        v: velocities [rad/s or m/s], shape (boxes, nv).
        torque: torques [N m or N], shape (boxes, nv).
        friction: joint friction.
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
            turning = self.terms.inertia_gradient.dot(steps[:, None]).spread((boxes, nv, *shape[1:]))
        constant = self.torque - self.terms.gravity - self._tanh * Interval.at(coulomb)
        weight = self.terms.gravity_gradient.times(w)
        found = range_of(self.v, linear, self._squares(w), turning, -weight)
        return found + constant[:, None].times(w)[:, 0]

    @cached_property
    def _tanh(self) -> Interval:
        return (self.v / Interval.at(self.friction.width)).tanh()

    def _squares(self, w: Array) -> Interval:
        """Coefficients of v_a v_b, a ≥ b, in ½ vᵀ (Σ w_k ∂M/∂q_k) v, shape (boxes, pairs, m)."""
        rows, columns = np.tril_indices(self.v.lower.shape[1])
        sums, part = self.terms.inertia_derivatives.times(w), np.where(rows == columns, 0.5, 1.0)[:, None]
        return Interval(sums.lower * part, sums.upper * part)  # exact


def range_of(v: Interval, linear: Interval, squares: Interval, turning: Interval | None, weight: Interval) -> Interval:
    """The range of linearᵀ v + Σ squares_ab v_a v_b + Σ_k ε_k (turning_kᵀ v + weight_k) over |ε_k| ≤ 1, (boxes, m).

    Args:
        v: boxes of velocities, shape (boxes, nv).
        linear: shape (boxes, nv, m).
        squares: for a ≥ b, row by row, shape (boxes, pairs, m).
        turning: indexed by k, then by v, shape (boxes, nv, nv, m); None: zero.
        weight: shape (boxes, nv, m).
    """
    import _armdyn_enclosure as enclosure

    corners, many = v.lower.shape[1] <= MOST_CORNERS, weight.lower.shape[-1]
    ends = np.ascontiguousarray(v.lower), np.ascontiguousarray(v.upper)
    tables = (
        None if each is None else (np.ascontiguousarray(each.lower), np.ascontiguousarray(each.upper))
        for each in (linear, squares, turning, weight)
    )
    return Interval(*enclosure.range_of(*ends, many, *tables, corners))


_ROUNDED = 1e-9
"""Part by which the shares are reduced, so that after rounding their sum is at most the whole."""


@dataclass(frozen=True, eq=False)
class Line:
    """One line of all joints' torque-speed curves: |τ + s v| ≤ c is a torque of at most c with a damping s.

    For w ≥ 0 a torque's w τ is at most w (c - s v), for w < 0 at most -w (c + s v). So is any average over a joint's
    lines, including the limits that are the same at all speeds. Near the speed limit this is less than the largest
    torque, in the parts of the proof that price velocity.

    Attributes:
        slope: s [N m s/rad or N s/m], shape (nv,).
        torque: τ + s v of all torques in the boxes [N m or N], shape (boxes, nv).
        given: whether each joint has such a line, shape (nv,); otherwise s is 0.
    """

    slope: Array
    torque: Interval
    given: Flags


def lines_of(actuators: ActuatorLimits, forces: Forces) -> tuple[Line, ...]:
    """Lines of the torque-speed curves over boxes of velocities; empty if torque limits are the same at all speeds.

    Raises:
        SpecError: the actuators have no lines, see `ActuatorLimits.lines`.
    """
    found, same, v = [], forces.torque, forces.v
    for slope, rest in zip(*actuators.lines, strict=True):
        given = np.isfinite(rest)
        # Beyond its no-load speed a joint brakes with at most its whole torque.
        upper = np.maximum(rest, up(actuators.lower + up(slope * v.upper)))
        lower = np.minimum(-rest, down(actuators.upper + down(slope * v.lower)))
        torque = Interval(np.where(given, lower, same.lower), np.where(given, upper, same.upper))
        found.append(Line(np.where(given, slope, 0.0), torque, given))
    return tuple(found)


def shares_of(lines: Array, whole: Array) -> Array:
    """Shares of the lines in multipliers w, shape (lines, nodes, nv); over the lines they sum up to at most 1.

    Args:
        lines: multipliers of the lines, shape (lines, nodes, nv).
        whole: w, shape (nodes, nv).
    """
    shares = np.clip(lines / np.where(whole == 0, 1.0, whole), 0.0, 1.0)
    return np.asarray(shares * (1 - _ROUNDED) / np.maximum(np.sum(shares, axis=0), 1.0))


def rate_by_lines(
    actuators: ActuatorLimits, forces: Forces, w: Array, shares: Array, way: Interval, steps: Interval | None = None
) -> Interval:
    """Enclosure of the largest value of `Forces.rate`, with torques within torque-speed curves.

    Args:
        actuators: actuators with the curves.
        forces: forces over boxes.
        w: multipliers, shape (boxes, nv, m).
        shares: shares of the lines in the multipliers, shape (lines, boxes, nv, m).
        way: see `Forces.rate`.
        steps: see `Forces.rate`.
    """
    if not shares.size:
        return forces.rate(w, way, steps)
    rest = Interval.at(np.zeros(w[:, 0].shape))
    for line, share in zip(lines_of(actuators, forces), shares, strict=True):
        part = Interval.at(w) * Interval.at(np.where(line.given[:, None], share, 0.0))
        above = (line.torque - Interval.at(forces.torque.upper)).upper[..., None]
        below = (line.torque - Interval.at(forces.torque.lower)).lower[..., None]
        rest = rest + (part * Interval.at(np.where(w > 0, above, below))).sum(1)
        way = way - part * Interval.at(line.slope[:, None])
    return forces.rate(w, way, steps) + rest
