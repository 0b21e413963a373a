"""Assembly of the nonlinear program from the equations of its intervals, with and without their middles.

The final time is copied to every knot (see `layout`), so that the Jacobian is block bidiagonal and the Hessian
block tridiagonal. A block is differentiated symbolically, once, and mapped: building costs the same for ten intervals
and for a thousand.

In the condensed Hermite-Simpson program of the search, forward dynamics give the middle of an interval from its ends,

    x_m = (x_k + x_{k+1}) / 2 + h / 8 (f_k - f_{k+1}),

by the equations of `interval` (Betts, Practical Methods for Optimal Control, 2010, section 4.5: compressed against
separated). The middle is eliminated, and the final time is one unknown instead of one per knot: half as many unknowns
and equations, the same solutions, and four fifths of the time per iteration. The price: limits of positions and
velocities hold at the knots only, not in the middle, and path constraints are impossible.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.arrays import Index
from armdyn.dynamics.motion import LOBATTO_3
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once, cached_property
from armdyn.optimal.constraints.rows import IntervalFunctions, StageRows, differentiated, intervals_of
from armdyn.optimal.mesh.interval import CollocationInterval, interval_functions, present_body
from armdyn.optimal.mesh.layout import CondensedLayout, Layout, Parameters
from armdyn.optimal.problem.options import Scheme


@dataclass(frozen=True, eq=False)
class Block:
    """Equations that are repeated with different unknowns.

    Attributes:
        one: equations at one place, a function of the unknowns and parameters there.
        unknowns: indices of the unknowns at each place, shape (width, places).
        parameters: indices of the parameters at each place, shape (count, places).
        summed: whether the equations are summed over all places, such as integrals along the path.
    """

    one: IntervalFunctions
    unknowns: Index
    parameters: Index
    summed: bool = False

    @property
    def places(self) -> int:
        """Number of places."""
        return int(self.unknowns.shape[1])

    @property
    def rows(self) -> int:
        """Number of equations at one place."""
        return int(self.one.defects.numel_out(0))

    @property
    def name(self) -> str:
        """Name of its equations."""
        return str(self.one.defects.name()).removesuffix("_defects")

    @property
    def equations(self) -> int:
        """Number of the block's equations in the program."""
        return self.rows * (1 if self.summed else self.places)

    def arguments(self, x: ca.MX, p: ca.MX) -> tuple[ca.MX, ca.MX]:
        """Unknowns and parameters, one column per place."""
        at, given = self.unknowns, self.parameters
        return (
            ca.reshape(x[at.ravel(order="F").tolist()], *at.shape),
            ca.reshape(p[given.ravel(order="F").tolist()], *given.shape),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Program:
    """A nonlinear program with its exact derivatives, ready for `casadi.nlpsol`.

    Attributes:
        functions: x, p, f, g for nlpsol.
        jacobian: (x, p) -> (g, ∂g/∂x).
        hessian: (x, p, σ, λ) -> upper triangle of ∂²(σ f + λᵀg)/∂x².
        blocks: blocks of the equations, in their order.
    """

    functions: dict[str, ca.MX]
    jacobian: ca.Function
    hessian: ca.Function
    blocks: tuple[Block, ...] = ()

    @cached_property
    def gradient(self) -> ca.Function:
        """(x, p) -> ∂f/∂x."""
        x, p, f = (self.functions[name] for name in "xpf")
        return ca.Function("gradient", [x, p], [ca.gradient(f, x)])


def build_nlp(dynamics: Dynamics, scheme: Scheme, intervals: int, rows: Sequence[StageRows] = ()) -> Program:
    """NLP of an arm: depends only on the model and the number of intervals, not on poses, limits, scales or payload.

    Args:
        dynamics: dynamics with a symbolic last body.
        scheme: transcription scheme.
        intervals: number of intervals.
        rows: rows after the equations of motion, each kind interval by interval; their own parameters follow
            `Parameters`.
    """
    layout, view = Layout(dynamics.nv, scheme), CollocationInterval(dynamics, scheme)
    unknowns, parameters = layout.intervals(intervals), Parameters.by_interval(dynamics.nv, intervals)
    blocks = [Block(interval_functions(dynamics, scheme), unknowns, parameters)]
    first = Parameters.size(dynamics.nv, intervals)
    for each in rows:
        here = intervals_of(each, (intervals,))
        numbers = (first + np.arange(each.numbers))[:, None].repeat(here.size, axis=1)
        own = np.vstack([parameters[:, here], numbers])
        blocks.append(Block(each.functions(view), unknowns[:, here], own, each.where == "sum"))
        first += each.numbers
    return program_of(blocks, layout.size(intervals))


def program_of(blocks: Sequence[Block], size: int, paid: Sequence[int] = (), price: int = 0) -> Program:
    """The program of blocks of equations, one block after the other, place by place.

    Args:
        blocks: at least one; together the blocks use every parameter of the program.
        size: number of unknowns.
        paid: indices of unknowns with a linear cost.
        price: index of the parameter that is the cost of each of their units.
    """
    total = sum(block.equations for block in blocks)
    x, p = ca.MX.sym("x", size), ca.MX.sym("p", 1 + max(int(np.max(block.parameters)) for block in blocks))
    sigma, lam = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", total)
    costs = [p[price] * ca.sum1(x[list(paid)])] if paid else []
    g, jacobian, hessian, row = [], _Entries(), _Entries(), 0
    for block in blocks:
        one, N, rows = block.one, block.places, block.rows
        given = block.arguments(x, p)
        if one.cost is not None:
            costs.append(ca.sum2(one.cost.map(N)(*given)))
        values = one.defects.map(N)(*given)
        g.append(ca.sum2(values) if block.summed else ca.vec(values))
        down, across = _pattern(one.jacobian_pattern)
        stride = 0 if block.summed else rows
        jacobian.add(down[:, None] + row + stride * np.arange(N), block.unknowns[across], one.jacobian.map(N)(*given))
        down, across = (block.unknowns[where] for where in _pattern(one.hessian_pattern))
        own = lam[row : row + block.equations]
        weights = ca.repmat(own, 1, N) if block.summed else ca.reshape(own, rows, N)
        nonzeros = one.hessian.map(N)(*given, ca.repmat(sigma, 1, N), weights)
        hessian.add(np.minimum(down, across), np.maximum(down, across), nonzeros)
        row += block.equations
    values, jacobian_matrix, hessian_matrix = ca.vertcat(*g), jacobian.matrix(total, size), hessian.matrix(size, size)
    names = ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
    return Program(
        functions={"x": x, "p": p, "f": sum(costs[1:], costs[0]), "g": values},
        jacobian=ca.Function("nlp_jac_g", [x, p], [values, jacobian_matrix], ["x", "p"], ["g", "jac_g_x"]),
        hessian=ca.Function("nlp_hess_l", [x, p, sigma, lam], [hessian_matrix], *names),
        blocks=tuple(blocks),
    )


class _Entries:
    """Nonzeros of a sparse matrix, collected block by block."""

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


def scatter(rows: Index, cols: Index, shape: tuple[int, int], nonzeros: ca.MX) -> ca.MX:
    """Sparse matrix from nonzeros with rows and columns; entries at the same place are added."""
    rows, cols = rows.ravel(order="F"), cols.ravel(order="F")
    places, which = np.unique(cols * shape[0] + rows, return_inverse=True)  # by columns, CasADi's order
    sparsity = ca.Sparsity.triplet(*shape, (places % shape[0]).tolist(), (places // shape[0]).tolist())
    gather = ca.Sparsity.triplet(places.size, rows.size, which.tolist(), list(range(rows.size)))
    return ca.MX(sparsity, ca.mtimes(ca.MX(ca.DM(gather, 1.0)), ca.vec(nonzeros)))


@dataclass(frozen=True, kw_only=True, eq=False)
class CondensedNlp(Program):
    """Program of a condensed layout.

    Attributes:
        middles: (w, p) -> states in the middle of the intervals, one column each, shape (2 nv, N).
    """

    middles: ca.Function


def build_condensed(dynamics: Dynamics, scheme: Scheme, intervals: int) -> CondensedNlp:
    """The condensed NLP of an arm; parameters and equations as in `assembly.build_nlp`, without the middles'.

    Args:
        dynamics: dynamics with a symbolic last body.
        scheme: a mesh's scheme, not that of arcs.
        intervals: number of intervals N.
    """
    layout, (one, middle) = CondensedLayout(Layout(dynamics.nv, scheme)), _interval(dynamics, scheme)
    block = Block(one, layout.intervals(intervals), Parameters.by_interval(dynamics.nv, intervals))
    program = program_of([block], layout.kept(intervals).size)
    x, p = program.functions["x"], program.functions["p"]
    middles = ca.Function("middles", [x, p], [middle.map(intervals)(*block.arguments(x, p))])
    return CondensedNlp(**vars(program), middles=middles)


@built_once(maxsize=16)
def _interval(dynamics: Dynamics, scheme: Scheme) -> tuple[IntervalFunctions, ca.Function]:
    """Functions of one interval, and its middle's state as a function of unknowns and parameters."""
    n, layout = dynamics.nv, CondensedLayout(Layout(dynamics.nv, scheme))
    y, p = ca.SX.sym("y", layout.width), ca.SX.sym("p", Parameters.size(n))
    by, body = Parameters.of(p, n), present_body(dynamics, p)
    scale = ca.vertcat(ca.repmat(by.length, n, 1), ca.repmat(by.speed, n, 1))
    left, first, right, last, duration = layout.parts(y)
    h = by.fraction * by.time * duration

    def rate(x: ca.SX, u: ca.SX) -> ca.SX:
        q, v = by.length * x[layout.full.knot.q], by.speed * x[layout.full.knot.v]
        scaled: ca.SX = ca.vertcat(v, dynamics.aba(q, v, by.effort * u, body)) / scale
        return scaled

    start, end = rate(left, first), rate(right, last)
    middle = (left + right) / 2 + h / 8 * (start - end)
    defects = right - left - h / 6 * (start + 4 * rate(middle, (first + last) / 2) + end)
    squares = sum(
        b * ca.dot(by.weights, u**2) for b, u in zip(LOBATTO_3.b, (first, (first + last) / 2, last), strict=True)
    )
    cost = by.fraction * duration * (1 + squares / 2)
    functions = differentiated("condensed", y, p, defects, cost, scheme.compile)
    return functions, ca.Function("condensed_middle", [y, p], [middle])
