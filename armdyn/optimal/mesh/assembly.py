"""Equations of a collocation interval, and the nonlinear program of all intervals.

The final time is copied to every knot (see `layout`), so that the Jacobian is block bidiagonal and the Hessian
block tridiagonal. A block is differentiated symbolically, once, and mapped: building costs the same for ten intervals
and for a thousand.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.arrays import Index
from armdyn.dynamics.motion import LOBATTO_3
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once, cached_property
from armdyn.optimal.constraints.rows import IntervalFunctions, StageRows, Stages, differentiated
from armdyn.optimal.mesh.layout import Layout, Parameters
from armdyn.optimal.problem.options import Scheme


def _stages(dynamics: Dynamics, scheme: Scheme) -> tuple[Stages, list[ca.SX], list[ca.SX]]:
    """Stages of one interval with unknowns y = (knot, inner, next knot), and the scaled states and torques there."""
    n, layout = dynamics.nv, Layout(dynamics.nv, scheme)
    y, p = ca.SX.sym("y", layout.width), ca.SX.sym("p", Parameters.size(n))
    by, body = Parameters.of(p, n), present_body(dynamics, p)
    left, inner, right = layout.parts(y)

    states = [left[layout.knot.state], inner[: 2 * n], right[layout.knot.state]]
    if layout.linear:
        torques = [(1 - c) * left[layout.knot.torque] + c * right[layout.knot.torque] for c in LOBATTO_3.c]
    else:
        torques = [inner[2 * n :]] * LOBATTO_3.c.size

    q, v = by.length * ca.horzcat(*states)[:n, :], by.speed * ca.horzcat(*states)[n:, :]
    tau = [by.effort * torque for torque in torques]
    a = [dynamics.aba(q[:, k], v[:, k], torque, body) for k, torque in enumerate(tau)]
    stages = Stages(
        y=y,
        p=p,
        h=by.fraction * by.time * left[layout.knot.time],
        c=LOBATTO_3.c,
        q=q,
        v=v,
        a=ca.horzcat(*a),
        tau=ca.horzcat(*tau),
        acceleration=by.speed / by.time,
        effort=by.effort,
        dynamics=dynamics,
    )
    return stages, states, torques


def present_body(dynamics: Dynamics, p: ca.SX) -> ca.SX:
    """Last body among an interval's parameters, see `only_present`."""
    return only_present(dynamics, Parameters.of(p, dynamics.nv).last_body)


def only_present(dynamics: Dynamics, numbers: ca.SX) -> ca.SX:
    """Dynamic parameters of a last body, shape (10,).

    Parameters that are zero for the arm, such as most products of inertia of a planar arm, are left out of the
    expressions.
    """
    if dynamics.last_body.size == 0:
        raise ValueError("a transcription takes Dynamics(robot, free_last_body=True)")
    body: ca.SX = ca.vertcat(*(numbers[i] if there else 0 for i, there in enumerate(dynamics.last_body != 0)))
    return body


@dataclass(frozen=True)
class CollocationInterval:
    """Symbolic equations of one collocation interval.

    Attributes:
        dynamics: dynamics with a symbolic last body.
        scheme: transcription scheme.
    """

    dynamics: Dynamics
    scheme: Scheme

    @property
    def compile(self) -> bool | None:
        """Whether the scheme compiles."""
        return self.scheme.compile

    def stages(self) -> Stages:
        """Stages of the interval in symbols."""
        return _stages(self.dynamics, self.scheme)[0]


@built_once(maxsize=16)
def interval_functions(dynamics: Dynamics, scheme: Scheme) -> IntervalFunctions:
    """Defects and cost of one interval, all scaled; cached by model and scheme."""
    n, layout, (one, states, torques) = dynamics.nv, Layout(dynamics.nv, scheme), _stages(dynamics, scheme)
    by, (left, _, right) = Parameters.of(one.p, n), layout.parts(one.y)
    scale = ca.vertcat(ca.repmat(by.length, n, 1), ca.repmat(by.speed, n, 1))
    rates = [ca.vertcat(one.v[:, k], one.a[:, k]) / scale for k in range(len(states))]
    defects = [
        state - states[0] - one.h * sum(a * rate for a, rate in zip(weights, rates, strict=True))
        for state, weights in zip(states[1:], LOBATTO_3.A[1:], strict=True)
    ]
    duration = left[layout.knot.time]
    square = sum(b * ca.dot(by.weights, torque**2) for b, torque in zip(LOBATTO_3.b, torques, strict=True))
    equations = ca.vertcat(*defects, right[layout.knot.time] - duration)
    return differentiated(
        "interval", one.y, one.p, equations, by.fraction * duration * (1 + square / 2), scheme.compile
    )


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
        here = each.intervals((intervals,))
        numbers = (first + np.arange(each.size))[:, None].repeat(here.size, axis=1)
        own = np.vstack([parameters[:, here], numbers])
        blocks.append(Block(each.functions(view), unknowns[:, here], own, each.where == "sum"))
        first += each.size
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
