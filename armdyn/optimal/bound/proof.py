"""A lower bound of a leg's duration, proven by multipliers.

Of every motion of duration T within the cells' boxes, and for any multipliers λ and w(t),

    λᵀ Δq = w(0)ᵀ p(0) − w(T)ᵀ p(T) + ∫ (λ + M ẇ)ᵀ v + wᵀ (τ + e) dt,

for the integral of d/dt (wᵀ p) is between. With w linear within each cell the integrand's supremum over a cell's
boxes is convex in w, so that its mean at both ends of the cell is no less than its mean over it. In the middle cell
w is constant and the integrand at most some ρ. A motion of duration h + c, h that of all other cells, can make the
way only if λᵀ Δq ≤ S + ρ c; hence c is bounded from below. Of many starts and goals those with the least λᵀ Δq count.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.enclosure.interval import Interval, down
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.leg import BoundLeg
from armdyn.optimal.bound.rates import accelerations
from armdyn.optimal.bound.reach import End
from armdyn.optimal.bound.relaxation import Multipliers

Array = NDArray[np.float64]


def proven(leg: BoundLeg, cells: Cells, forces: Forces, by: Multipliers) -> float:
    """No motion of the leg that takes as long as the cells, or longer, is faster than this [s]; 0 says nothing."""
    k, outer = cells.middle, cells.outer
    lengths, way, w = Interval.at(cells.lengths), Interval.at(by.way), by.momentum
    steps = _differences(w) / lengths[:, None]
    ways = way + _differences(by.speed) / lengths[:, None]
    both = np.stack([w[:-1], w[1:]], axis=2)
    rates = forces[outer].rate(both, ways[:, :, None], steps[:, :, None])
    speed, most = np.abs(by.speed), _finite(accelerations(leg, cells))
    accelerated = (Interval.at(speed[:-1]) + Interval.at(speed[1:])) * Interval.at(most[outer])
    mean = (rates[:, 0] + rates[:, 1] + accelerated.sum(1)) * Interval.at(0.5)
    made = (lengths * mean).sum(0) + _at_ends(leg, by)
    middle = forces[k : k + 1].rate(w[k][:, None], way[:, None])[0, 0]
    middle = middle + (Interval.at(speed[k]) * Interval.at(most[k])).sum(0)
    left = leg.least_way(by.way) - made.upper
    if left <= 0:
        return 0.0
    if middle.upper <= 0:
        return cells.longest
    return float((lengths.sum(0) + Interval.at(down(left)) / Interval.at(middle.upper)).lower)


def _at_ends(leg: BoundLeg, by: Multipliers) -> Interval:
    """w(0)ᵀ p(0) − w(T)ᵀ p(T), and likewise for the speeds that accelerations change."""
    total = Interval.at(0.0)
    for outward, node in ((1, 0), (-1, -1)):
        end = End.at(leg, outward)
        if end is not None:
            share = (end.momentum * Interval.at(by.momentum[node])).sum(0)
            share = share + (Interval.at(end.v) * Interval.at(by.speed[node])).sum(0)
            total = total + (share if outward > 0 else -share)
    return total


def _differences(nodes: Array) -> Interval:
    return Interval.at(nodes[1:]) - Interval.at(nodes[:-1])


def _finite(limits: Array) -> Array:
    """Limits, 0 where there is none: its multiplier is 0, too."""
    return np.where(np.isfinite(limits), limits, 0.0)
