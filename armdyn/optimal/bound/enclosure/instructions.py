"""A CasADi Function evaluated in intervals or affine forms, over many boxes at once.

CasADi gives a Function of SX as a list of instructions, each of one operation. Those that depend on each other least
are done together: all products of one depth are one product of arrays, and so on.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, Self, TypeVar

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.errors import BridgeError

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Enclosure(Protocol):
    """An arithmetic for evaluating a Function: its numbers are arrays, whose first axis counts boxes."""

    @property
    def parts(self) -> tuple[Array, ...]:
        """The arrays that it is made of."""

    @staticmethod
    def number(value: float) -> tuple[float, ...]:
        """A float's parts."""

    def __neg__(self) -> Self: ...
    def __add__(self, other: Self) -> Self: ...
    def __sub__(self, other: Self) -> Self: ...
    def __mul__(self, other: Self) -> Self: ...

    def square(self) -> Self:
        """x²."""

    def sin(self) -> Self:
        """Sines."""

    def cos(self) -> Self:
        """Cosines."""


Kind = TypeVar("Kind", bound=Enclosure)

_UNARY: dict[int, Callable[[Any], Any]] = {
    ca.OP_ASSIGN: lambda x: x,
    ca.OP_NEG: lambda x: -x,
    ca.OP_TWICE: lambda x: x + x,
    ca.OP_SQ: lambda x: x.square(),
    ca.OP_SIN: lambda x: x.sin(),
    ca.OP_COS: lambda x: x.cos(),
}
_BINARY: dict[int, Callable[[Any, Any], Any]] = {
    ca.OP_ADD: lambda x, y: x + y,
    ca.OP_SUB: lambda x, y: x - y,
    ca.OP_MUL: lambda x, y: x * y,
}
"""What inertia and gravity of an arm, and their derivatives, are made of."""


@dataclass(frozen=True, eq=False)
class _Instruction:
    """Operations of one kind on values that are known.

    Attributes:
        operation: its code in CasADi.
        into: places of the results, one after the other.
        operands: places of the first operands, as many, and of the second ones if there are two.
    """

    operation: int
    into: slice
    operands: tuple[Indices, ...]


@dataclass(frozen=True, eq=False)
class LevelledFunction:
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
    steps: tuple[_Instruction, ...]
    outputs: Indices
    size: int

    @classmethod
    def of(cls, function: ca.Function) -> LevelledFunction:
        """A Function of SX.

        Raises:
            BridgeError: it has an operation that is not known here, or is of another shape.
        """
        if not function.is_a("SXFunction") or function.n_in() != 1 or function.n_out() != 1:
            raise BridgeError(f"{function} cannot be evaluated in intervals: it is no Function of SX, of one vector")
        return _Reading(function).levelled()

    def __call__(self, x: Kind) -> Kind:
        """The value, m places, of an argument of n places."""
        memory = [np.zeros((self.size + 1, *part.shape[1:])) for part in x.parts]
        for own, given in zip(memory, x.parts, strict=True):
            for place, index in self.inputs:
                own[place] = given[index]
        for place, value in self.constants:
            for own, part in zip(memory, x.number(value), strict=True):
                own[place] = part
        kind = type(x)
        for step in self.steps:
            operands = [kind(*(own[places] for own in memory)) for places in step.operands]
            result = _UNARY[step.operation](*operands) if len(operands) == 1 else _BINARY[step.operation](*operands)
            for own, part in zip(memory, result.parts, strict=True):
                own[step.into] = part
        return kind(*(own[self.outputs] for own in memory))


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
        code, sources, places = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
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

    def levelled(self) -> LevelledFunction:
        """The instructions, grouped by depth and kind, with the results of a group side by side."""
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
            sources = (first,) if key[1] in _UNARY else (first, second)
            steps.append(_Instruction(key[1], into, tuple(place[source] for source in sources)))
            begin = into.stop
        return LevelledFunction(
            inputs=tuple((int(place[name]), index) for name, index in self.inputs),
            constants=tuple((int(place[name]), value) for name, value in self.constants),
            steps=tuple(steps),
            outputs=place[self.outputs],
            size=len(order),
        )
