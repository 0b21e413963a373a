"""CasADi Functions evaluated in intervals or affine forms over many boxes at once, by the C++ extension.

CasADi lists the instructions of an SX Function, each one operation on places in memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.errors import BridgeError
from armdyn.optimal.bound.enclosure.interval import Interval, rounding

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
            code, sources, into = (
                function.instruction_id(k),
                function.instruction_input(k),
                function.instruction_output(k),
            )
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
