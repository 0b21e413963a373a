"""Inertia, its slopes and gravity over boxes of joint positions: all that the momentum's equation needs.

An instruction does not know that its operands hang together, which makes a box's values too wide, to first order in
its size. The mean value theorem does: f(q) = f(c) + ∂f/∂q (q − c) with a slope from within the box, where the excess
is of second order. Both are true, so that their intersection is (R. Moore, Interval Analysis, 1966, section 6.3).
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.exclusive import built_once
from armdyn.optimal.bound.instructions import IntervalFunction
from armdyn.optimal.bound.interval import Interval

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Terms:
    """What they are over boxes of joint positions.

    Attributes:
        inertia: M(q) [kg m²], shape (boxes, nv, nv).
        slopes: ∂M_cd/∂q_a for the `pairs` (c, d) [kg m²/rad], shape (boxes, pairs, nv).
        gravity: g(q) [N m], shape (boxes, nv).
    """

    inertia: Interval
    slopes: Interval
    gravity: Interval

    def __getitem__(self, boxes: slice | Indices) -> Terms:
        return Terms(self.inertia[boxes], self.slopes[boxes], self.gravity[boxes])


def pairs(nv: int) -> tuple[Indices, Indices]:
    """Rows and columns of a lower triangle, row by row: (0, 0), (1, 0), (1, 1), …"""
    return np.tril_indices(nv)


def terms_over(dynamics: Dynamics, q: Interval) -> Terms:
    """The terms over boxes of joint positions [rad or m], shape (boxes, nv)."""
    n, boxes = dynamics.nv, len(q.lower)
    rows, columns = pairs(n)
    size = len(rows) + n
    centres = Interval.at(np.clip(q.lower + (q.upper - q.lower) / 2, q.lower, q.upper))
    both = np.concatenate([centres.lower, q.lower]), np.concatenate([centres.upper, q.upper])
    values = _program(dynamics)(Interval(both[0].T, both[1].T))
    at_centres, natural = values[:size, :boxes], values[:size, boxes:]
    slopes = values[size:, boxes:].shaped((n, size, boxes))
    mean = at_centres + (slopes * (q - centres).turned((1, 0))[:, None]).sum(0)
    narrow = natural.meet(mean)
    full = np.empty((n, n), dtype=np.intp)
    full[rows, columns] = full[columns, rows] = np.arange(len(rows))
    return Terms(
        inertia=narrow[full].turned((2, 0, 1)),
        slopes=slopes[:, : len(rows)].turned((2, 1, 0)),
        gravity=narrow[len(rows) :].turned((1, 0)),
    )


@built_once(maxsize=16)
def _program(dynamics: Dynamics) -> IntervalFunction:
    """The lower triangle of M, then g, and the derivatives of both joint after joint, as one vector of q."""
    q = ca.SX.sym("q", dynamics.nv)
    inertia = dynamics.crba(q)
    triangle = [inertia[int(a), int(b)] for a, b in zip(*pairs(dynamics.nv), strict=True)]
    value = ca.vertcat(*triangle, dynamics.gravity(q))
    every = ca.vertcat(value, ca.vec(ca.jacobian(value, q)))
    return IntervalFunction.of(ca.Function("terms", [q], [ca.cse(every)]))
