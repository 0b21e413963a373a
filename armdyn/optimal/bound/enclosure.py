"""Enclosures over boxes: intervals, affine forms of CasADi functions, and inertia and gravity of the momentum equation.

A sum, difference or product of floats is rounded to nearest, so that the next float outward, or the one after, is a
bound. Products of matrices and running sums use the a-priori bound instead (N. Higham, Accuracy and Stability of
Numerical Algorithms, 2nd ed. 2002, section 3.1): n terms err by at most γ = n u/(1 − n u) of the sum of their sizes,
u = 2⁻⁵³.

CasADi lists the instructions of an SX Function, each one operation on places in memory.

M(q) and g(q) are affine forms, which keep the dependence of different entries of M on the same joint. M's are the
better of two: by M's own instructions, and by those of its derivatives in Taylor's integral, M(c + δ) = M(c) + Σ δ_k ∫
∂M/∂q_k(c + s δ) ds for s from 0 to 1, whose second derivatives are exact: about a third of the remainder by products of
forms, until the box is so large that the third order matters.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.arrays import Array
from armdyn.dynamics.symbolic import Dynamics
from armdyn.errors import BridgeError
from armdyn.locks import built_once

_UNIT = 2.0**-53
"""Unit roundoff u of a float."""

_LEAST, _LARGEST = 5e-324, float(np.finfo(float).max)
"""Least and largest positive float."""

_TINY = 1e-300
"""Bound on underflow in sums [unit of the sum]."""

ROUNDED = 1e-12
"""Bound on the relative error of a few dozen operations, of 1e-15 each, and on the error of the library's tanh."""


@dataclass(frozen=True, eq=False)
class Interval:
    """Intervals, one per place of two arrays.

    Attributes:
        lower: lower ends, of any shape.
        upper: upper ends, likewise; not below the lower ends.
    """

    lower: Array
    upper: Array

    @classmethod
    def at(cls, value: ArrayLike) -> Interval:
        """Intervals of zero width at given numbers."""
        exact = np.asarray(value, dtype=float)
        return cls(exact, exact)

    @property
    def magnitude(self) -> Array:
        """Largest |x| of each interval."""
        return np.maximum(np.abs(self.lower), np.abs(self.upper))

    @property
    def mignitude(self) -> Array:
        """Smallest |x| of each interval."""
        return np.maximum(np.maximum(self.lower, -self.upper), 0.0)

    @property
    def centre(self) -> Array:
        """A float in the middle of each interval."""
        return np.asarray(np.minimum(np.maximum(self.lower / 2 + self.upper / 2, self.lower), self.upper))

    @property
    def radius(self) -> Array:
        """Largest distance of the ends from `centre`."""
        centre = self.centre
        return np.where(self.lower == self.upper, 0.0, up(np.maximum(self.upper - centre, centre - self.lower)))

    def __getitem__(self, key: Any) -> Interval:
        return Interval(self.lower[key], self.upper[key])

    def __neg__(self) -> Interval:
        return Interval(-self.upper, -self.lower)

    def __add__(self, other: Interval) -> Interval:
        return Interval(down(self.lower + other.lower), up(self.upper + other.upper))

    def __sub__(self, other: Interval) -> Interval:
        return Interval(down(self.lower - other.upper), up(self.upper - other.lower))

    def __mul__(self, other: Interval) -> Interval:
        return _hull(x * y for x in (self.lower, self.upper) for y in (other.lower, other.upper))

    def __truediv__(self, other: Interval) -> Interval:
        """Quotient; the divisor must not contain zero."""
        return _hull(x / y for x in (self.lower, self.upper) for y in (other.lower, other.upper))

    def tanh(self) -> Interval:
        """Hyperbolic tangents."""
        return Interval(np.maximum(np.tanh(self.lower) - ROUNDED, -1.0), np.minimum(np.tanh(self.upper) + ROUNDED, 1.0))

    def outward(self) -> Interval:
        """Round outward once more."""
        return Interval(down(self.lower), up(self.upper))

    def meet(self, other: Interval) -> Interval:
        """Intersection; if empty by rounding, the nearer ends."""
        lower, upper = np.maximum(self.lower, other.lower), np.minimum(self.upper, other.upper)
        return Interval(np.minimum(lower, upper), np.maximum(lower, upper))

    def intersection(self, other: Interval) -> Interval:
        """Intersection; empty if the lower end is above the upper one."""
        return Interval(np.maximum(self.lower, other.lower), np.minimum(self.upper, other.upper))

    @property
    def around(self) -> Interval:
        """Hull along the first axis."""
        return Interval(np.min(self.lower, axis=0), np.max(self.upper, axis=0))

    def hull(self, other: Interval) -> Interval:
        """Convex hull of the union."""
        return Interval(np.minimum(self.lower, other.lower), np.maximum(self.upper, other.upper))

    def transposed(self, axes: tuple[int, ...]) -> Interval:
        """Transpose."""
        return Interval(
            np.ascontiguousarray(self.lower.transpose(axes)), np.ascontiguousarray(self.upper.transpose(axes))
        )

    def shaped(self, shape: tuple[int, ...]) -> Interval:
        """Reshape."""
        return Interval(self.lower.reshape(shape), self.upper.reshape(shape))

    def spread(self, shape: tuple[int, ...]) -> Interval:
        """The interval broadcast to a greater shape."""
        return Interval(np.broadcast_to(self.lower, shape), np.broadcast_to(self.upper, shape))

    def dot(self, other: Interval) -> Interval:
        """The matrix product with another, shapes (…, l, m) with (…, m, n)."""
        product = self.times(other.centre)
        radius = self.magnitude @ other.radius
        radius = radius + rounding(self.lower.shape[-1], radius)
        return Interval(down(product.lower - radius), up(product.upper + radius))

    def times(self, matrix: Array) -> Interval:
        """The product with a matrix of floats on the right, shapes (…, m) or (…, l, m) with (…, m, n)."""
        plus, minus = np.maximum(matrix, 0.0), np.maximum(-matrix, 0.0)
        error = rounding(2 * matrix.shape[-2], self.magnitude @ np.abs(matrix))
        return Interval(self.lower @ plus - self.upper @ minus - error, self.upper @ plus - self.lower @ minus + error)

    def sum(self, axis: int) -> Interval:
        """Sum along an axis."""
        error = rounding(self.lower.shape[axis], np.sum(self.magnitude, axis))
        return Interval(np.sum(self.lower, axis) - error, np.sum(self.upper, axis) + error)

    def running(self) -> Interval:
        """Partial sums along the first axis, from none to all, shape (n + 1, …)."""
        sizes = _from_zero(np.cumsum(self.magnitude, 0))
        error = rounding(len(self.lower), sizes)
        return Interval(_from_zero(np.cumsum(self.lower, 0)) - error, _from_zero(np.cumsum(self.upper, 0)) + error)

    def propagated(self, ways: Interval) -> Interval:
        """Tighten each box along the first axis by all boxes before it, plus the displacements to it.

        The least of a box's upper ends and those of all boxes before it, each plus the sum of the displacements since;
        likewise for lower ends.
        """
        sizes = _from_zero(np.cumsum(ways.magnitude, 0))
        low, high = (_from_zero(np.cumsum(end, 0)) for end in (ways.lower, ways.upper))
        most, least = np.minimum.accumulate(self.upper - high), np.maximum.accumulate(self.lower - low)
        below, above = (rounding(len(sizes) + 2, 2 * sizes + np.abs(end)) for end in (least, most))
        return self.intersection(Interval(low + least - below, high + most + above))


def joined(parts: Sequence[Interval]) -> Interval:
    """Intervals joined along the first axis."""
    return Interval(np.concatenate([x.lower for x in parts]), np.concatenate([x.upper for x in parts]))


def stacked(parts: Sequence[Interval], axis: int) -> Interval:
    """Intervals of one shape along a new axis."""
    return Interval(np.stack([x.lower for x in parts], axis), np.stack([x.upper for x in parts], axis))


def _hull(ends: Iterable[Array]) -> Interval:
    """The interval hull of four arrays, rounded outward."""
    a, b, c, d = ends
    return Interval(
        down(np.minimum(np.minimum(a, b), np.minimum(c, d))), up(np.maximum(np.maximum(a, b), np.maximum(c, d)))
    )


def down(x: Array) -> Array:
    """Round down by at most two floats, see `_step`."""
    return np.asarray(np.minimum(x - _step(x), _LARGEST))


def up(x: Array) -> Array:
    """Round up by at most two floats."""
    return np.asarray(np.maximum(x + _step(x), -_LARGEST))


def _step(x: Array) -> Array:
    """Step from each float to at least the next one and at most two, in a fifth of the time of `numpy.nextafter`.

    S. Rump, P. Zimmermann, S. Boldo, G. Melquiond, Computing predecessor and successor in rounding to nearest, BIT 49,
    2009: u (1 + 2 u) |x| + the least subnormal number.
    """
    return np.asarray(np.minimum(np.abs(x), _LARGEST) * (_UNIT * (1 + 2 * _UNIT)) + _LEAST)


def sum_down(numbers: Sequence[float]) -> float:
    """Sum, rounded down."""
    total = 0.0
    for number in numbers:
        total = number if total == 0 else float(down(np.array(total + number)))
    return total


def rounding(terms: int, sizes: Array) -> Array:
    """Upper bound on the rounding error of a sum of products, from the sum of their sizes.

    Four times γ, because that sum and operations on the result are rounded, too.
    """
    return np.asarray(4 * (terms + 2) * _UNIT * sizes + _TINY)


def _from_zero(sums: Array) -> Array:
    return np.concatenate([np.zeros_like(sums[:1]), sums])


TURN = Interval(down(np.array(2 * np.pi)), up(np.array(2 * np.pi)))
"""A whole turn [rad]."""


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
    turned = q.transposed((1, 0))
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
        inertia=_constant(inertia)[full].transposed((2, 0, 1)),
        gravity=_constant(fall).transposed((1, 0)),
        inertia_gradient=Interval.at(inertia.gradient)[full].transposed((3, 2, 0, 1)),
        gravity_gradient=Interval.at(fall.gradient).transposed((2, 1, 0)),
        inertia_derivatives=inertia_derivatives.interval.meet(derivatives.over(turned))
        .shaped((n, len(rows), boxes))
        .transposed((2, 1, 0)),
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
