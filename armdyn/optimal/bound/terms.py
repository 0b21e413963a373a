"""Inertia and gravity over boxes of joint positions, for the momentum equation.

M(q) and g(q) are affine forms, which keep the dependence of different entries of M on the same joint. M's are the
better of two: by M's own instructions, and by those of its derivatives in Taylor's integral, M(c + δ) = M(c) + Σ δ_k ∫
∂M/∂q_k(c + s δ) ds for s from 0 to 1, whose second derivatives are exact: about a third of the remainder by products of
forms, until the box is so large that the third order matters.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.arrays import Array
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.bound.enclosure.instructions import Affine, EnclosedFunction
from armdyn.optimal.bound.enclosure.interval import Interval, rounding

Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Terms:
    """Inertia and gravity over boxes: values at the centre, and derivatives in ε, |ε_k| ≤ 1 at the box's faces.

    Attributes:
        inertia: M at ε = 0 including its nonlinear part in ε [kg m²], shape (boxes, nv, nv).
        gravity: g at ε = 0, likewise [N m], shape (boxes, nv).
        inertia_gradient: ∂M_ab/∂ε_k [kg m²], shape (boxes, k, a, b).
        gravity_gradient: ∂g_a/∂ε_k [N m], shape (boxes, k, a).
        inertia_derivatives: ∂M_ab/∂q_k for a ≥ b, row by row, anywhere in the box [kg m²/rad], shape (boxes, pairs, k).
    """

    inertia: Interval
    gravity: Interval
    inertia_gradient: Interval
    gravity_gradient: Interval
    inertia_derivatives: Interval

    def __getitem__(self, boxes: slice | Indices) -> Terms:
        return Terms(**{name: part[boxes] for name, part in vars(self).items()})


def terms_over(dynamics: Dynamics, q: Interval) -> Terms:
    """Terms over boxes of joint positions [rad or m], shape (boxes, nv)."""
    n, boxes = dynamics.nv, len(q.lower)
    rows, columns = np.tril_indices(n)
    full = np.empty((n, n), dtype=np.intp)
    full[rows, columns] = full[columns, rows] = np.arange(len(rows))
    values, derivatives = _programs(dynamics)
    turned = q.turned((1, 0))
    forms, inertia_derivatives = values.forms(turned), derivatives.forms(turned)
    at_centres = values.over(Interval.at(turned.centre))[: len(rows)]
    better = _by_derivatives(at_centres, inertia_derivatives, turned.radius)
    inertia, fall = Affine(*(part[: len(rows)] for part in forms.parts)), Affine(*(p[len(rows) :] for p in forms.parts))
    narrower = better.rest < inertia.rest
    inertia = Affine(
        np.where(narrower, better.centre, inertia.centre),
        np.where(narrower[:, None], better.gradient, inertia.gradient),
        np.where(narrower, better.rest, inertia.rest),
    )
    return Terms(
        inertia=_constant(inertia)[full].turned((2, 0, 1)),
        gravity=_constant(fall).turned((1, 0)),
        inertia_gradient=Interval.at(inertia.gradient)[full].turned((3, 2, 0, 1)),
        gravity_gradient=Interval.at(fall.gradient).turned((2, 1, 0)),
        inertia_derivatives=inertia_derivatives.interval.meet(derivatives.over(turned))
        .shaped((n, len(rows), boxes))
        .turned((2, 1, 0)),
    )


def _constant(forms: Affine) -> Interval:
    """Constant and remainder of the affine forms."""
    return Interval(forms.centre - forms.rest, forms.centre + forms.rest).outward()


def _by_derivatives(at_centres: Interval, derivatives: Affine, radius: Array) -> Affine:
    """Affine forms of functions by the mean value theorem: values at the centres, derivatives over the boxes.

    Args:
        at_centres: values at the centres, shape (functions, boxes).
        derivatives: affine forms of ∂/∂q_1 of all functions, then of ∂/∂q_2, …: nv times as many.
        radius: radii of the boxes, shape (nv, boxes).
    """
    count, (nv, boxes) = len(at_centres.lower), radius.shape
    linear = derivatives.centre.reshape(nv, count, boxes) * radius[:, None]
    second = derivatives.gradient.reshape(nv, count, nv, boxes) * radius[:, None, None]
    left = np.sum(derivatives.rest.reshape(nv, count, boxes) * radius[:, None], axis=0)
    second = (second + second.transpose(2, 1, 0, 3)) / 4  # coefficients of ε_k ε_l, both orders
    squares = np.einsum("kckb->cb", second) / 2  # coefficients of ε_k², which is ½ ± ½
    half = np.einsum("kckb->cb", np.abs(second)) / 2
    size = np.sum(np.abs(second), axis=(0, 2))
    rest = at_centres.radius + left + (size - half)
    whole = at_centres.magnitude + np.sum(np.abs(linear), axis=0) + size + left
    return Affine(at_centres.centre + squares, linear.transpose(1, 0, 2), rest + rounding(2 * nv * nv + 16, whole))


@built_once(maxsize=16)
def _programs(dynamics: Dynamics) -> tuple[EnclosedFunction, EnclosedFunction]:
    """Functions of q: the lower triangle of M, then g; and derivatives of the triangle, joint after joint."""
    q = ca.SX.sym("q", dynamics.nv)
    inertia = dynamics.crba(q)
    triangle = ca.vertcat(*(inertia[int(a), int(b)] for a, b in zip(*np.tril_indices(dynamics.nv), strict=True)))
    values = ca.vertcat(triangle, dynamics.gravity(q))
    derivatives = ca.vec(ca.jacobian(triangle, q))
    return (
        EnclosedFunction.of(ca.Function("values", [q], [ca.cse(values)])),
        EnclosedFunction.of(ca.Function("slopes", [q], [ca.cse(derivatives)])),
    )
