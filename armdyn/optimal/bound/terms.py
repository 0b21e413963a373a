"""Inertia and gravity over boxes of joint positions: all that the momentum's equation needs.

M(q) and g(q) are affine forms, so that what different entries of M owe to one and the same joint stays known. The
slopes ∂M/∂q of the Coriolis forces, which are of second order in the velocities anyway, are intervals.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.exclusive import built_once
from armdyn.optimal.bound.enclosure.affine import Affine
from armdyn.optimal.bound.enclosure.instructions import LevelledFunction
from armdyn.optimal.bound.enclosure.interval import Interval

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Terms:
    """What they are over boxes: at the centre, and how they change from there with ε, |ε_k| ≤ 1 at the box's faces.

    Attributes:
        inertia: M at ε = 0 and all of it that is not linear in ε [kg m²], shape (boxes, nv, nv).
        gravity: likewise g [N m], shape (boxes, nv).
        inertia_slopes: ∂M_ab/∂ε_k [kg m²], shape (boxes, k, a, b).
        gravity_slopes: ∂g_a/∂ε_k [N m], shape (boxes, k, a).
        bends: ∂M_ab/∂q_k for a ≥ b, row by row, anywhere in the box [kg m²/rad], shape (boxes, pairs, k).
    """

    inertia: Interval
    gravity: Interval
    inertia_slopes: Interval
    gravity_slopes: Interval
    bends: Interval

    def __getitem__(self, boxes: slice | Indices) -> Terms:
        return Terms(**{name: part[boxes] for name, part in vars(self).items()})


def terms_over(dynamics: Dynamics, q: Interval) -> Terms:
    """The terms over boxes of joint positions [rad or m], shape (boxes, nv)."""
    n, boxes = dynamics.nv, len(q.lower)
    rows, columns = np.tril_indices(n)
    full = np.empty((n, n), dtype=np.intp)
    full[rows, columns] = full[columns, rows] = np.arange(len(rows))
    values, slopes = _programs(dynamics)
    turned = q.turned((1, 0))
    forms = values(Affine.over(turned))
    constant = Interval(forms.centre - forms.rest, forms.centre + forms.rest).outward()
    linear = Interval.at(forms.slopes)
    return Terms(
        inertia=constant[full].turned((2, 0, 1)),
        gravity=constant[len(rows) :].turned((1, 0)),
        inertia_slopes=linear[full].turned((3, 2, 0, 1)),
        gravity_slopes=linear[len(rows) :].turned((2, 1, 0)),
        bends=slopes(turned).shaped((n, len(rows), boxes)).turned((2, 1, 0)),
    )


@built_once(maxsize=16)
def _programs(dynamics: Dynamics) -> tuple[LevelledFunction, LevelledFunction]:
    """Of q: the lower triangle of M, then g; and the derivatives of that triangle, joint after joint."""
    q = ca.SX.sym("q", dynamics.nv)
    inertia = dynamics.crba(q)
    triangle = ca.vertcat(*(inertia[int(a), int(b)] for a, b in zip(*np.tril_indices(dynamics.nv), strict=True)))
    values = ca.vertcat(triangle, dynamics.gravity(q))
    slopes = ca.vec(ca.jacobian(triangle, q))
    return (
        LevelledFunction.of(ca.Function("values", [q], [ca.cse(values)])),
        LevelledFunction.of(ca.Function("slopes", [q], [ca.cse(slopes)])),
    )
