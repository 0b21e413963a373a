"""A lower bound of a leg's duration, proven by multipliers.

Of every motion of duration T within the cells' boxes, and for any multipliers λ and w(t),

    λᵀ Δq = w(0)ᵀ p(0) − w(T)ᵀ p(T) + ∫ (λ + M ẇ)ᵀ v + wᵀ (τ + e) dt,

for the integral of d/dt (wᵀ p) is between. The integrand's supremum over a cell's boxes is convex in (w, ẇ): with w a
polynomial within each cell, its mean at the control points is no less than its mean over the cell. In the middle cell
w is constant and the integrand at most some ρ. A motion of duration h + c, h that of all other cells, can make the
way only if λᵀ Δq ≤ S + ρ c; hence c is bounded from below. Of many starts and goals those with the least λᵀ Δq count.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.enclosure.interval import Interval, down, stacked
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.rates import accelerations
from armdyn.optimal.bound.reach import at_ends
from armdyn.optimal.bound.relaxation import Multipliers
from armdyn.optimal.bound.torque_speed import rate_by_lines

Array = NDArray[np.float64]


def proven(leg: BoundLeg, cells: Cells, forces: Forces, by: Multipliers) -> float:
    """No motion of the leg that takes as long as the cells, or longer, is faster than this [s]; 0 says nothing."""
    k, outer, motors = cells.middle, cells.outer, leg.torque.actuators
    lengths, way = Interval.at(cells.lengths), Interval.at(by.way)
    ways = way + _differences(by.speed) / lengths[:, None]
    w, steps, shares = _controls(leg, cells, forces, by)
    rates = rate_by_lines(motors, forces[outer], w, shares, ways[:, :, None], steps)
    speed, most = np.abs(by.speed), _finite(accelerations(leg, cells))
    accelerated = (Interval.at(speed[:-1]) + Interval.at(speed[1:])) * Interval.at(most[outer])
    mean = rates.sum(1) / Interval.at(float(w.shape[2])) + accelerated.sum(1) * Interval.at(0.5)
    made = (lengths * mean).sum(0) + at_ends(leg, by.momentum, by.speed)
    inner, own = by.momentum[k][None, :, None], by.shares[:, k][:, None, :, None]
    middle = rate_by_lines(motors, forces[k : k + 1], inner, own, way[None, :, None])[0, 0]
    middle = middle + (Interval.at(speed[k]) * Interval.at(most[k])).sum(0)
    left = leg.least_way(by.way) - made.upper
    if left <= 0:
        return 0.0
    if middle.upper <= 0:
        return cells.longest
    return float((lengths.sum(0) + Interval.at(down(left)) / Interval.at(middle.upper)).lower)


def _controls(leg: BoundLeg, cells: Cells, forces: Forces, by: Multipliers) -> tuple[Array, Interval, Array]:
    """Multipliers w at the control points of all cells but the middle one, their slopes in time, and the lines' shares.

    The control points are those of Bernstein's polynomials: w is linear, or quadratic where torque falls with speed, so
    that what M ẇ differs from s w by is of second order in the cell's length, not of first.
    """
    w, shares, lengths = by.momentum, by.shares, Interval.at(cells.lengths[:, None])
    ends, steps = (w[:-1], w[1:]), _differences(w) / lengths
    both = shares[:, :-1], shares[:, 1:]
    if not shares.size:
        return np.stack(ends, axis=2), steps[:, :, None], np.stack(both, axis=3)
    damped = np.einsum("kj,knj,nj->nj", leg.torque.actuators.lines[0], shares, w)
    inertia, change = forces.terms.inertia.centre[cells.outer], damped[:-1] - damped[1:]
    bent = np.linalg.solve(inertia, change[..., None])[..., 0] * cells.lengths[:, None] / 4
    middle = (ends[0] + ends[1]) / 2 + bent
    twice, at = Interval.at(2.0), [Interval.at(each) for each in (ends[0], middle, ends[1])]
    first, last = (twice * (after - before) / lengths for before, after in pairwise(at))
    slopes = stacked([first, steps, last], axis=2)
    return (
        np.stack([ends[0], middle, ends[1]], axis=2),
        slopes,
        np.stack([both[0], (both[0] + both[1]) / 2, both[1]], axis=3),
    )


def _differences(nodes: Array) -> Interval:
    return Interval.at(nodes[1:]) - Interval.at(nodes[:-1])


def _finite(limits: Array) -> Array:
    """Limits, 0 where there is none: its multiplier is 0, too."""
    return np.where(np.isfinite(limits), limits, 0.0)
