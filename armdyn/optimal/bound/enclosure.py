"""Enclosures over boxes: affine forms of CasADi functions, and inertia and gravity of the momentum equation.

CasADi lists the instructions of an SX Function, each one operation on places in memory.

M(q) and g(q) are affine forms, which keep the dependence of different entries of M on the same joint. M's are the
better of two: by M's own instructions, and by those of its derivatives in Taylor's integral, M(c + δ) = M(c) + Σ δ_k ∫
∂M/∂q_k(c + s δ) ds for s from 0 to 1, whose second derivatives are exact: about a third of the remainder by products of
forms, until the box is so large that the third order matters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.arrays import Array
from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import BridgeError
from armdyn.locks import built_once
from armdyn.optimal.bound.interval import Interval, rounding

_OPERATIONS = {
    code: number
    for number, code in enumerate(
        (ca.OP_INPUT, ca.OP_CONST, ca.OP_OUTPUT, ca.OP_ASSIGN, ca.OP_NEG, ca.OP_TWICE, ca.OP_SQ, ca.OP_SIN, ca.OP_COS,
         ca.OP_ADD, ca.OP_SUB, ca.OP_MUL)
    )
}  # fmt: skip
"""Operations in an arm's inertia and gravity and their derivatives: operation codes of `_enclosure/program.hpp`."""


@dataclass(frozen=True, eq=False)
class Affine:
    """Affine forms, one per place, over several boxes at once: first-order enclosures, with a bound of the remainder.

    A form is c + Σ g_k ε_k ± r with every |ε_k| ≤ 1, ε_k the same in all forms: the overestimation is of second order
    in the box's size, where intervals, which lose the dependence of their operands, are of first order (L. de
    Figueiredo and J. Stolfi, Affine arithmetic: concepts and applications, Numerical Algorithms 37, 2004). Errors of
    rounding are part of r. Their arithmetic is in `_enclosure/affine_forms.cpp`.

    Attributes:
        centre: c, shape (places, boxes).
        gradient: g, shape (places, nv, boxes).
        rest: r, not negative, shape (places, boxes).
    """

    centre: Array
    gradient: Array
    rest: Array

    @property
    def parts(self) -> tuple[Array, ...]:
        """The arrays of the forms."""
        return self.centre, self.gradient, self.rest

    @property
    def far(self) -> Array:
        """Largest distance from the centre, before rounding."""
        return np.asarray(np.sum(np.abs(self.gradient), axis=1) + self.rest)

    @property
    def interval(self) -> Interval:
        """Interval hull."""
        far = self.far
        radius = far + rounding(2 + self.gradient.shape[1], far + np.abs(self.centre))
        return Interval(self.centre - radius, self.centre + radius)

    def __sub__(self, other: Affine) -> Affine:
        centre, gradient, rest = self.centre - other.centre, self.gradient - other.gradient, self.rest + other.rest
        size = np.abs(centre) + np.sum(np.abs(gradient), axis=1) + rest
        return Affine(centre, gradient, rest + rounding(gradient.shape[1] + 2, size))


@dataclass(frozen=True, eq=False)
class EnclosedFunction:
    """Function of one vector of n places with one dense vector of m places as its value.

    Attributes:
        program: compiled program of the extension.
    """

    program: Any

    @classmethod
    def of(cls, function: ca.Function) -> EnclosedFunction:
        """Compile a Function of SX.

        Raises:
            BridgeError: the Function has an operation without an interval extension, or another shape.
        """
        import _armdyn_enclosure as enclosure

        if not function.is_a("SXFunction") or function.n_in() != 1 or function.n_out() != 1:
            raise BridgeError(f"{function} cannot be evaluated in intervals: it is no Function of SX, of one vector")
        count, rows, out_rows = function.n_instructions(), function.sparsity_in(0).row(), function.sparsity_out(0).row()
        steps, values = np.zeros((count, 4), dtype=np.int32), np.zeros(count)
        for k in range(count):
            code, sources = function.instruction_id(k), function.instruction_input(k)
            into = function.instruction_output(k)
            if code not in _OPERATIONS:
                raise BridgeError(f"{function} has an operation (code {code}) that is not known in intervals")
            if code == ca.OP_INPUT:
                operands = into[0], rows[sources[1]], 0
            elif code == ca.OP_OUTPUT:
                operands = out_rows[into[1]], sources[0], 0
            elif code == ca.OP_CONST:
                operands, values[k] = (into[0], 0, 0), function.instruction_constant(k)
            else:
                operands = into[0], sources[0], sources[-1]
            steps[k] = _OPERATIONS[code], *operands
        places = function.sz_w() + 1
        return cls(enclosure.Program(steps, values, places, function.numel_in(0), function.numel_out(0)))

    def over(self, boxes: Interval) -> Interval:
        """Intervals of the value over boxes, shape (n, boxes): shape (m, boxes)."""
        return Interval(*self.program.in_intervals(boxes.lower, boxes.upper))

    def forms(self, boxes: Interval) -> Affine:
        """Affine forms of the value over boxes, shape (n, boxes); ε_k: coordinate k, from -1 to 1 in the box."""
        return Affine(*self.program.in_affine_forms(boxes.centre, boxes.radius))


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
