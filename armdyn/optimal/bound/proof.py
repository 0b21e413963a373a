"""A lower bound of a leg's duration, proven by multipliers.

Of every motion of duration T within the cells' boxes, and for any multipliers λ and w(t),

    λᵀ Δq = w(0)ᵀ p(0) − w(T)ᵀ p(T) + ∫ (λ + M ẇ)ᵀ v + wᵀ (τ + e) dt,

for the integral of d/dt (wᵀ p) is between. With w linear within each cell the integrand's supremum over a cell's
boxes is convex in w, so that its mean at both ends of the cell is no less than its mean over it. In the middle cell
w is constant and the integrand at most some ρ. A motion of duration h + c, h that of all other cells, can make the
way only if λᵀ Δq ≤ S + ρ c; hence c is bounded from below.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.bound.cells import Cells
from armdyn.optimal.bound.forces import Forces
from armdyn.optimal.bound.interval import Interval
from armdyn.optimal.bound.leg import Leg
from armdyn.optimal.bound.reach import End
from armdyn.optimal.bound.relaxation import Multipliers

Array = NDArray[np.float64]


def proven(leg: Leg, cells: Cells, forces: Forces, by: Multipliers) -> float:
    """No motion of the leg that takes as long as the cells, or longer, is faster than this [s]."""
    w, speed = _ends_free(leg, by)
    k, outer = cells.middle, cells.outer
    lengths = Interval.at(cells.lengths)
    way = Interval.at(by.way)
    steps = (Interval.at(w[1:]) - Interval.at(w[:-1])) / lengths[:, None]
    pull = way + (forces.terms.inertia[outer] * steps[:, None]).sum(2)
    rates = np.zeros(2 * k)
    if speed is not None:
        pull = pull + (Interval.at(speed[1:]) - Interval.at(speed[:-1])) / lengths[:, None]
        sizes = Interval.at(np.abs(speed)) * Interval.at(leg.acceleration)
        sizes = sizes.sum(1)
        rates = ((sizes[:-1] + sizes[1:]) * Interval.at(0.5)).upper
    own = Forces(forces.terms[outer], forces.v[outer], forces.limits, forces.friction)
    both = np.stack([w[:-1], w[1:]], axis=2)
    most = own.rate(both, Interval(pull.lower[:, :, None], pull.upper[:, :, None]))
    mean = (most[:, 0] + most[:, 1]) * Interval.at(0.5) + Interval.at(rates)
    made = (lengths * mean).sum(0)
    for outward, node in ((1, 0), (-1, 2 * k)):
        end = End.at(leg, outward)
        if end is not None:
            share = (end.momentum * Interval.at(w[node])).sum(0)
            made = made + share if outward > 0 else made - share
            if speed is not None:
                share = (Interval.at(end.v) * Interval.at(speed[node])).sum(0)
                made = made + share if outward > 0 else made - share
    middle = Forces(forces.terms[k : k + 1], forces.v[k : k + 1], forces.limits, forces.friction)
    cruise = middle.rate(w[k][:, None], Interval.at(by.way[None, :, None]))[0, 0]
    if speed is not None:
        cruise = cruise + (Interval.at(np.abs(speed[k])) * Interval.at(leg.acceleration)).sum(0)
    left = (way * leg.away).sum(0).lower - made.upper
    if cruise.upper <= 0:
        return cells.longest if left > 0 else 0.0
    if left <= 0:
        return 0.0
    between = Interval.at(left) / Interval.at(cruise.upper)
    return float((lengths.sum(0) + between).lower)


def _ends_free(leg: Leg, by: Multipliers) -> tuple[Array, Array | None]:
    """The multipliers, zero at an end whose velocity is not given."""
    every = [None if x is None else x.copy() for x in (by.momentum, by.speed)]
    for node, v in ((0, leg.v_start), (-1, leg.v_goal)):
        for x in every:
            if v is None and x is not None:
                x[node] = 0.0
    return every[0], every[1]  # type: ignore[return-value]  # momentum is always there
