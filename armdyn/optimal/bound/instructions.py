"""A CasADi Function evaluated in intervals, over many boxes at once.

CasADi gives a Function of SX as a list of instructions, each of one operation. Those that depend on each other least
are done together: all products of one depth are one product of arrays, and so on.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.errors import BridgeError
from armdyn.optimal.bound.interval import Interval

Indices = NDArray[np.intp]

_UNARY: dict[int, Callable[[Interval], Interval]] = {
    ca.OP_ASSIGN: lambda x: x,
    ca.OP_NEG: lambda x: -x,
    ca.OP_TWICE: lambda x: x + x,
    ca.OP_SQ: Interval.square,
    ca.OP_SIN: Interval.sin,
    ca.OP_COS: Interval.cos,
    ca.OP_TANH: Interval.tanh,
    ca.OP_INV: lambda x: Interval.at(np.ones_like(x.lower)) / x,
}
_BINARY: dict[int, Callable[[Interval, Interval], Interval]] = {
    ca.OP_ADD: Interval.__add__,
    ca.OP_SUB: Interval.__sub__,
    ca.OP_MUL: Interval.__mul__,
}
"""What the dynamics of arms are made of. A division is by what is nowhere zero: constants."""


@dataclass(frozen=True, eq=False)
class _Step:
    """Operations of one kind on values that are known.

    Attributes:
        operation: its code in CasADi.
        into: places of the results, one after the other.
        first: places of the first operands, as many.
        second: of the second ones; of no meaning for operations of one operand.
    """

    operation: int
    into: slice
    first: Indices
    second: Indices


@dataclass(frozen=True, eq=False)
class IntervalFunction:
    """A Function of one vector with one dense vector as its value.

    Attributes:
        inputs: place in memory of each number of the argument that matters, and its index there.
        constants: place and value of each.
        steps: what is done, in order.
        outputs: place of each number of the value; -1: it is zero.
        size: places in memory.
    """

    inputs: tuple[tuple[int, int], ...]
    constants: tuple[tuple[int, float], ...]
    steps: tuple[_Step, ...]
    outputs: Indices
    size: int

    @classmethod
    def of(cls, function: ca.Function) -> IntervalFunction:
        """A Function of SX.

        Raises:
            BridgeError: it has an operation that is not known here, or is of another shape.
        """
        if not function.is_a("SXFunction") or function.n_in() != 1 or function.n_out() != 1:
            raise BridgeError(f"{function} cannot be evaluated in intervals: it is no Function of SX, of one vector")
        return _Reading(function).levelled()

    def __call__(self, boxes: Interval) -> Interval:
        """The value's intervals, shape (m, boxes), over boxes of the argument, shape (n, boxes)."""
        count = boxes.lower.shape[1]
        lower, upper = np.zeros((self.size + 1, count)), np.zeros((self.size + 1, count))
        for place, index in self.inputs:
            lower[place], upper[place] = boxes.lower[index], boxes.upper[index]
        for place, value in self.constants:
            lower[place] = upper[place] = value
        for step in self.steps:
            a = Interval(lower[step.first], upper[step.first])
            if step.operation in _UNARY:
                result = _UNARY[step.operation](a)
            else:
                result = _BINARY[step.operation](a, Interval(lower[step.second], upper[step.second]))
            lower[step.into], upper[step.into] = result.lower, result.upper
        return Interval(lower[self.outputs], upper[self.outputs])


class _Reading:
    """A Function's instructions with a name for every value: CasADi reuses its places in memory."""

    def __init__(self, function: ca.Function):
        self.inputs: list[tuple[int, int]] = []
        self.constants: list[tuple[int, float]] = []
        self.operations: list[tuple[int, int, int, int]] = []
        self.outputs = np.full(function.numel_out(0), -1, dtype=np.intp)
        self._rows = function.sparsity_in(0).row()
        self._out_rows = function.sparsity_out(0).row()
        self._held: dict[int, int] = {}
        self._depth: list[int] = []
        for k in range(function.n_instructions()):
            self._read(function, k)

    def _read(self, function: ca.Function, k: int) -> None:
        code, sources, places = function.instruction_id(k), function.instruction_input(k), function.instruction_output(k)
        if code == ca.OP_OUTPUT:
            self.outputs[self._out_rows[places[1]]] = self._held[sources[0]]
            return
        if code == ca.OP_INPUT:
            self.inputs.append((self._new(places[0], 0), self._rows[sources[1]]))
        elif code == ca.OP_CONST:
            self.constants.append((self._new(places[0], 0), function.instruction_constant(k)))
        elif code in _UNARY or code in _BINARY:
            a, b = (self._held[source] for source in (sources[0], sources[-1]))
            depth = 1 + max(self._depth[a], self._depth[b])
            self.operations.append((code, self._new(places[0], depth), a, b))
        else:
            raise BridgeError(f"{function} has an operation (code {code}) that is not known in intervals")

    def _new(self, place: int, depth: int) -> int:
        self._held[place] = len(self._depth)
        self._depth.append(depth)
        return self._held[place]

    def levelled(self) -> IntervalFunction:
        """The same, operations of one depth and kind together, their results side by side."""
        groups: dict[tuple[int, int], list[tuple[int, int, int]]] = defaultdict(list)
        for code, name, a, b in self.operations:
            groups[self._depth[name], code].append((name, a, b))
        known = [name for name, _ in self.inputs] + [name for name, _ in self.constants]
        order = known + [name for key in sorted(groups) for name, _, _ in groups[key]]
        place = np.empty(len(order) + 1, dtype=np.intp)
        place[order] = np.arange(len(order))
        place[-1] = len(order)  # of the number zero
        steps, begin = [], len(known)
        for key in sorted(groups):
            _, first, second = np.array(groups[key], dtype=np.intp).T
            into = slice(begin, begin + len(first))
            steps.append(_Step(key[1], into, place[first], place[second]))
            begin = into.stop
        return IntervalFunction(
            inputs=tuple((int(place[name]), index) for name, index in self.inputs),
            constants=tuple((int(place[name]), value) for name, value in self.constants),
            steps=tuple(steps),
            outputs=place[self.outputs],
            size=len(order),
        )
