"""Proof of a lower bound of a leg's duration by multipliers.

For every motion within the cells' boxes and any multipliers w(t), continuous, and λ(t),

    ∫ λᵀ v dt = w(0)ᵀ p(0) − w(T)ᵀ p(T) + ∫ (λ + M ẇ)ᵀ v + wᵀ (τ + e) dt,

since the last terms are the integral of d/dt (wᵀ p). λ is constant between nodes at which positions are known, and
jumps there, so that the left side is

    λ_last ᵀ q(T) − λ_first ᵀ q(0) + Σ_k (λ_before − λ_behind)ᵀ q_k,

each term of which has its least value over the positions of its node. The integrand's supremum over a fixed
cell's boxes is convex in (w, ẇ): with w a polynomial within each cell, its mean at the control points is no less than
its mean over the cell. In every elastic cell w is constant and the integrand at most some ρ. With H the sum of all
fixed cells, S the integral's upper bound there, and c the time in the elastic ones, Λ ≤ S + max ρ c; hence c is bounded
from below. The momentum at a region that is passed counts on both its sides and cancels: no bound of the velocity
there is lost.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.forces import Forces, rate_by_lines
from armdyn.optimal.bound.interval import Interval, down, rounding, stacked
from armdyn.optimal.bound.leg import BoundLeg, LegEnd
from armdyn.optimal.bound.reach import accelerations, at_ends


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Dual variables of the proof: any values give a valid bound, those of a linear program a tight one.

    Attributes:
        way: λ in every cell, shape (n, nv) [1/rad or 1/m, with λᵀ Δq about 1, or s times as much].
        momentum: w at the nodes of the fixed cells [1/(N m s), or s times as much], shape (fixed + 1, nv): linear
            within these cells, constant in an elastic one between them.
        speed: multipliers of the acceleration limits, likewise [s/rad or s/m, or s times as much]; zero without limits.
        shares: share of `momentum` for each line of the torque-speed curves, shape (lines, fixed + 1, nv).
        combinations: combinations of the equations at all n + 1 nodes, see `LegEnd.least`; None: the best ones.
    """

    way: Array
    momentum: Array
    speed: Array
    shares: Array
    combinations: Sequence[Array | None]

    def ramp(self, leg: BoundLeg, cells: Cells) -> float:
        """Time after the start, or before the goal, in which torque or acceleration matters [s]: the longer one."""
        torque = leg.torque.actuators.strongest
        most = np.max(accelerations(leg, cells), axis=0)
        worth = np.abs(self.momentum) @ torque + np.abs(self.speed) @ np.where(np.isfinite(most), most, 0.0)
        counts = worth > leg.policy.idle * np.max(worth)
        times = np.append(0.0, np.cumsum(cells.side))
        k = cells.middle
        return float(np.max(times, where=counts[: k + 1] | counts[: k - 1 : -1], initial=0.0))


def proven(leg: BoundLeg, cells: Cells, forces: Forces, ends: Sequence[LegEnd | None], by: Multipliers) -> float:
    """Proven lower bound on the duration of the leg's motions within the cells [s]; 0 proves nothing.

    Args:
        leg: leg with its ends.
        cells: cells of the leg.
        forces: forces over the cells.
        ends: known positions at the nodes.
        by: multipliers.
    """
    fixed, free, motors = cells.fixed, np.flatnonzero(cells.elastic), leg.torque.actuators
    lengths, way, at = Interval.at(cells.lengths[fixed]), Interval.at(by.way), cells.node[free]
    w, steps, shares = _controls(leg, cells, forces, by)
    rates = rate_by_lines(
        motors, forces[fixed], w, shares, (way[fixed] + _differences(by.speed) / lengths[:, None])[:, :, None], steps
    )
    speed, most = np.abs(by.speed), _finite(accelerations(leg, cells))
    accelerated = (Interval.at(speed[:-1]) + Interval.at(speed[1:])) * Interval.at(most[fixed])
    mean = rates.sum(1) / Interval.at(float(w.shape[2])) + accelerated.sum(1) * Interval.at(0.5)
    made = (lengths * mean).sum(0) + at_ends(leg, by.momentum, by.speed)
    inner, own = by.momentum[at][:, :, None], by.shares[:, at][..., None]
    between = rate_by_lines(motors, forces[free], inner, own, way[free][:, :, None])[:, 0]
    between = between + (Interval.at(speed[at]) * Interval.at(most[free])).sum(1)
    left, rate = (_least_ways(ends, by) - made).lower, float(np.max(between.upper))
    if left <= 0:
        return 0.0
    if rate <= 0:
        return np.inf
    return float((lengths.sum(0) + Interval.at(down(left)) / Interval.at(rate)).lower)


def _least_ways(ends: Sequence[LegEnd | None], by: Multipliers) -> Interval:
    """Least ∫ λᵀ v dt over the positions at the nodes."""
    none, total = np.zeros_like(by.way[:1]), Interval.at(0.0)
    jumps = np.concatenate([none, by.way]) - np.concatenate([by.way, none])
    for end, jump, combination in zip(ends, jumps, by.combinations, strict=True):
        if end is not None and np.any(jump):
            error = rounding(2, np.abs(jump) @ end.q.magnitude)
            total = total + Interval.at(end.least(jump, combination) - error)
    return total


def _controls(leg: BoundLeg, cells: Cells, forces: Forces, by: Multipliers) -> tuple[Array, Interval, Array]:
    """Multipliers w at the control points of the fixed cells, their time derivatives, and the lines' shares.

    The control points are those of Bernstein polynomials: w is linear, or quadratic for torque that falls with speed,
    so that M ẇ − s w is of second order in the cell's length, not of first.
    """
    w, shares, lengths = by.momentum, by.shares, cells.lengths[cells.fixed, None]
    ends, steps = (w[:-1], w[1:]), _differences(w) / Interval.at(lengths)
    both = shares[:, :-1], shares[:, 1:]
    if not shares.size:
        return np.stack(ends, axis=2), steps[:, :, None], np.stack(both, axis=3)
    damped = np.einsum("kj,knj,nj->nj", leg.torque.actuators.lines[0], shares, w)
    inertia, change = forces.terms.inertia.centre[cells.fixed], damped[:-1] - damped[1:]
    correction = np.linalg.solve(inertia, change[..., None])[..., 0] * lengths / 4
    middle = (ends[0] + ends[1]) / 2 + correction
    twice, at = Interval.at(2.0), [Interval.at(each) for each in (ends[0], middle, ends[1])]
    first, last = (twice * (after - before) / Interval.at(lengths) for before, after in pairwise(at))
    slopes = stacked([first, steps, last], axis=2)
    return (
        np.stack([ends[0], middle, ends[1]], axis=2),
        slopes,
        np.stack([both[0], (both[0] + both[1]) / 2, both[1]], axis=3),
    )


def _differences(nodes: Array) -> Interval:
    return Interval.at(nodes[1:]) - Interval.at(nodes[:-1])


def _finite(limits: Array) -> Array:
    """Limits, with 0 for infinite ones: their multiplier is 0, too."""
    return np.where(np.isfinite(limits), limits, 0.0)
