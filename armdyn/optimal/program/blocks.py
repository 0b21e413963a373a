"""Equations that are the same at many places, and the nonlinear program that several such make together.

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
        one: at one place: of its unknowns and its parameters.
        index: which of the program's unknowns those are, a column for every place.
        own: how many parameters every place has for itself.
        shared: whether the parameters that all blocks share follow them.
        common: how many parameters all places of this block share, after those.
    """

    one: IntervalFunctions
    index: Index
    own: int
    shared: bool = False
    common: int = 0

    @property
    def places(self) -> int:
        """How many."""
        return int(self.index.shape[1])

    @property
    def rows(self) -> int:
        """Equations at one place."""
        return int(self.one.defects.numel_out(0))

    @property
    def parameters(self) -> int:
        """How many numbers it takes, besides those that all blocks share."""
        return self.own * self.places + self.common

    def arguments(self, x: ca.MX, p: ca.MX, shared: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Unknowns and parameters, a column for every place.

        Args:
            x: the program's unknowns.
            p: the block's parameters: those of the places one after the other, then the common ones.
            shared: the parameters that all blocks share.
        """
        width, places = self.index.shape
        given = [ca.reshape(p[: self.own * places], self.own, places)]
        if self.shared:
            given.append(ca.repmat(shared, 1, places))
        if self.common:
            given.append(ca.repmat(p[self.own * places :], 1, places))
        return ca.reshape(x[self.index.ravel(order="F").tolist()], width, places), ca.vertcat(*given)


def program_of(blocks: Sequence[Block], size: int, shared: int, paid: Sequence[int]) -> Program:
    """The program of blocks: their equations follow each other, place by place, and so do their parameters.

    Args:
        blocks: at least one.
        size: number of unknowns.
        shared: number of parameters that all blocks share, after their own; the last is what a unit of `paid` costs.
        paid: unknowns that cost something themselves.
    """
    own, total = sum(block.parameters for block in blocks), sum(block.rows * block.places for block in blocks)
    x, p = ca.MX.sym("x", size), ca.MX.sym("p", own + shared)
    sigma, lam = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", total)
    f, g, jacobian, hessian = p[-1] * ca.sum1(x[list(paid)]), [], _Entries(), _Entries()
    row = place = 0
    for block in blocks:
        one, N, rows = block.one, block.places, block.rows
        y, given = block.arguments(x, p[place : place + block.parameters], p[own:])
        f += ca.sum2(one.cost.map(N)(y, given))
        g.append(ca.vec(one.defects.map(N)(y, given)))
        down, across = _pattern(one.jacobian_pattern)
        jacobian.add(down[:, None] + row + rows * np.arange(N), block.index[across], one.jacobian.map(N)(y, given))
        down, across = (block.index[where] for where in _pattern(one.hessian_pattern))
        weights = ca.reshape(lam[row : row + rows * N], rows, N)
        nonzeros = one.hessian.map(N)(y, given, ca.repmat(sigma, 1, N), weights)
        hessian.add(np.minimum(down, across), np.maximum(down, across), nonzeros)
        row, place = row + rows * N, place + block.parameters
    equations = ca.vertcat(*g)
    return Program(
        functions={"x": x, "p": p, "f": f, "g": equations},
        jacobian=jacobian_function(x, p, equations, jacobian.matrix(total, size)),
        hessian=hessian_function(x, p, sigma, lam, hessian.matrix(size, size)),
    )


class _Entries:
    """Nonzeros of a sparse matrix, gathered block by block."""

    def __init__(self) -> None:
        self._rows: list[Index] = []
        self._cols: list[Index] = []
        self._values: list[ca.MX] = []

    def add(self, rows: Index, cols: Index, values: ca.MX) -> None:
        if rows.size:
            self._rows.append(rows.ravel(order="F"))
            self._cols.append(cols.ravel(order="F"))
            self._values.append(ca.vec(values))

    def matrix(self, rows: int, cols: int) -> ca.MX:
        return scatter(np.concatenate(self._rows), np.concatenate(self._cols), (rows, cols), ca.vertcat(*self._values))


def _pattern(sparsity: ca.Sparsity) -> tuple[Index, Index]:
    row, col = (np.array(place, dtype=int) for place in sparsity.get_triplet())
    return row, col
