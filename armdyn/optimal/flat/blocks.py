"""Equations that are the same many times over, and the nonlinear program that they make together.

A block is differentiated once and mapped to all places where it holds, as an interval of collocation is.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.program.assembly import Program, hessian_function, jacobian_function, scatter
from armdyn.optimal.program.interval import IntervalFunctions

Index = NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Block:
    """Equations that hold at many places.

    Attributes:
        one: at one place: of its own unknowns and parameters.
        index: which of the program's unknowns those are, a column for every place.
        parameters: how many numbers each place has of its own.
        shared: whether the shared parameters follow them.
    """

    one: IntervalFunctions
    index: Index
    parameters: int
    shared: bool = False

    @property
    def places(self) -> int:
        """How many."""
        return int(self.index.shape[1])

    @property
    def rows(self) -> int:
        """Equations at one place."""
        return int(self.one.defects.numel_out(0))


def program_of(blocks: Sequence[Block], size: int, shared: int, paid: Sequence[int]) -> Program:
    """The program of blocks, whose equations follow each other, place by place.

    Args:
        blocks: of which the parameters follow each other likewise, before the shared ones.
        size: number of unknowns.
        shared: number of parameters that all blocks may use; the last of them is what a unit of `paid` costs.
        paid: unknowns that cost something themselves.
    """
    own = [block.parameters * block.places for block in blocks]
    x, p = ca.MX.sym("x", size), ca.MX.sym("p", sum(own) + shared)
    common, place = p[sum(own) :], 0
    total, sigma = sum(block.rows * block.places for block in blocks), ca.MX.sym("lam_f")
    lam, first = ca.MX.sym("lam_g", total), 0
    f, g = common[-1] * ca.sum1(x[list(paid)]), []
    jacobian, hessian = _Entries(), _Entries()
    for block, count in zip(blocks, own, strict=True):
        one, N, rows = block.one, block.places, block.rows
        y = ca.reshape(x[block.index.ravel(order="F").tolist()], block.index.shape[0], N)
        given = ca.vertcat(
            ca.reshape(p[place : place + count], block.parameters, N), ca.repmat(common if block.shared else ca.MX(0, 1), 1, N)
        )
        f += ca.sum2(one.cost.map(N)(y, given))
        g.append(ca.vec(one.defects.map(N)(y, given)))
        row, col = _pattern(one.jacobian_pattern)
        jacobian.add(row[:, None] + first + rows * np.arange(N), block.index[col], one.jacobian.map(N)(y, given))
        row, col = _pattern(one.hessian_pattern)
        low, high = np.sort([block.index[row], block.index[col]], axis=0)
        weights = ca.reshape(lam[first : first + rows * N], rows, N)
        hessian.add(low, high, one.hessian.map(N)(y, given, ca.repmat(sigma, 1, N), weights))
        place, first = place + count, first + rows * N
    all_g = ca.vertcat(*g)
    return Program(
        functions={"x": x, "p": p, "f": f, "g": all_g},
        jacobian=jacobian_function(x, p, all_g, jacobian.matrix(total, size)),
        hessian=hessian_function(x, p, sigma, lam, hessian.matrix(size, size)),
    )


class _Entries:
    """Nonzeros of a sparse matrix, gathered block by block."""

    def __init__(self) -> None:
        self._rows: list[Index] = []
        self._cols: list[Index] = []
        self._values: list[ca.MX] = []

    def add(self, rows: Index, cols: Index, values: ca.MX) -> None:
        self._rows.append(rows.ravel(order="F"))
        self._cols.append(cols.ravel(order="F"))
        self._values.append(ca.vec(values))

    def matrix(self, rows: int, cols: int) -> ca.MX:
        return scatter(np.concatenate(self._rows), np.concatenate(self._cols), (rows, cols), ca.vertcat(*self._values))


def _pattern(sparsity: ca.Sparsity) -> tuple[Index, Index]:
    row, col = (np.array(place, dtype=int) for place in sparsity.get_triplet())
    return row, col
