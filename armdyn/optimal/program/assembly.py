"""From an arm to a nonlinear program: direct collocation, written once for every tableau.

The unknowns stand in the order of time, and the final time is copied to every knot, so that the
Jacobian is block bidiagonal and the Hessian block tridiagonal:

    w = [knot_0 | inner_0 | knot_1 | inner_1 | … | knot_N]
    knot_k  = q, v, T, and the torque if it is linear between knots
    inner_k = the stages that are no knots, the torques if they are not linear, the accelerations if the
              dynamics are inverse

One interval is differentiated symbolically, once, and mapped N times: building costs the same for
ten intervals and for a thousand.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.exclusive import built_once
from armdyn.optimal.program.compiled import compiled
from armdyn.optimal.task.scheme import Scheme

Array = NDArray[np.float64]
Index = NDArray[np.int_]


@dataclass(frozen=True)
class Layout:
    """Where in a block of unknowns what stands; every range counts scaled numbers."""

    nv: int
    scheme: Scheme

    @property
    def knot(self) -> int:
        """Size of a knot's block: q, v, T and, if linear, the torque."""
        return 2 * self.nv + 1 + (self.nv if self.scheme.control == "linear" else 0)

    @property
    def stages(self) -> int:
        """Size of the states of the inner stages of an interval."""
        return 2 * self.nv * len(self.scheme.tableau.inner)

    @property
    def inner(self) -> int:
        """Size of an interval's own block."""
        accelerations = self.nv * self.scheme.tableau.c.size if self.scheme.dynamics == "inverse" else 0
        return self.stages + self.torques + accelerations

    @property
    def torques(self) -> int:
        """Size of an interval's own torques, which come after its stages."""
        return self.nv * {"linear": 0, "constant": 1, "stage": self.scheme.tableau.c.size}[self.scheme.control]

    def size(self, intervals: int) -> int:
        """Number of all unknowns."""
        return (self.knot + self.inner) * intervals + self.knot


def parameters_of(joints: int) -> int:
    """How many an NLP has besides the interval fractions: T, q and v scales, effort weights and scales, last body."""
    return 3 + 2 * joints + 10


@dataclass(frozen=True)
class _Interval:
    """One interval: unknowns y = (knot, inner, next knot), parameters, and what follows from them at its stages.

    Parameters: its fraction of the duration; the scales of T, q and v; the weights of the scaled torques' squares;
    the scales of the torques; the dynamic parameters of the last joint's body.
    """

    y: ca.SX
    p: ca.SX
    left: ca.SX
    right: ca.SX
    states: list[ca.SX]
    torques: list[ca.SX]
    velocities: list[ca.SX]
    accelerations: list[ca.SX]
    balances: list[ca.SX]


def _interval(dynamics: Dynamics, scheme: Scheme) -> _Interval:
    """Scaled states and torques, velocities, accelerations [rad/s²], how far inverse dynamics are from balance."""
    if dynamics.last_body.size == 0:
        raise ValueError("a transcription takes Dynamics(robot, free_last_body=True)")
    n, tableau, layout = dynamics.nv, scheme.tableau, Layout(dynamics.nv, scheme)
    y = ca.SX.sym("y", 2 * layout.knot + layout.inner)
    p = ca.SX.sym("p", 1 + parameters_of(n))
    _, time, length, speed = ca.vertsplit(p[:4])
    effort = p[4 + n : 4 + 2 * n]
    # What the body has none of, as a planar arm most products of inertia, is no part of the expressions.
    body = ca.vertcat(*(p[4 + 2 * n + i] if present else 0 for i, present in enumerate(dynamics.last_body != 0)))
    left, inner, right = y[: layout.knot], y[layout.knot : layout.knot + layout.inner], y[-layout.knot :]

    states = [inner[2 * n * i : 2 * n * (i + 1)] for i in range(len(tableau.inner))]
    if tableau.starts_at_knot:
        states.insert(0, left[: 2 * n])
    if tableau.ends_at_knot:
        states.append(right[: 2 * n])
    if scheme.control == "linear":
        u = [(1 - c) * left[2 * n + 1 :] + c * right[2 * n + 1 :] for c in tableau.c]
    else:
        own = ca.vertsplit(inner[layout.stages : layout.stages + layout.torques], n)
        u = own if scheme.control == "stage" else own * tableau.c.size

    velocities, accelerations, balances = [], [], []
    for i, (x, torque) in enumerate(zip(states, u, strict=True)):
        q, v = length * x[:n], speed * x[n:]
        if scheme.dynamics == "forward":
            a = dynamics.aba(q, v, effort * torque, body)
        else:
            first = layout.inner - n * (tableau.c.size - i)
            a = inner[first : first + n] * speed / time
            balances.append(dynamics.rnea(q, v, a, body) / effort - torque)
        velocities.append(v)
        accelerations.append(a)
    return _Interval(y, p, left, right, states, u, velocities, accelerations, balances)


def _equations(dynamics: Dynamics, scheme: Scheme) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Unknowns, parameters, defects and cost of one interval, all scaled."""
    n, tableau, one = dynamics.nv, scheme.tableau, _interval(dynamics, scheme)
    fraction, time, length, speed = ca.vertsplit(one.p[:4])
    weights, left, right = one.p[4 : 4 + n], one.left, one.right
    scale = ca.vertcat(ca.repmat(length, n, 1), ca.repmat(speed, n, 1))
    h = fraction * time * left[2 * n]
    rates = [ca.vertcat(v, a) / scale for v, a in zip(one.velocities, one.accelerations, strict=True)]
    defects = list(one.balances)
    start = left[: 2 * n]
    for i in range(tableau.c.size):
        if np.any(tableau.A[i]):
            rise = sum(tableau.A[i, j] * rates[j] for j in range(tableau.c.size))
            defects.append(one.states[i] - start - h * rise)
    if not tableau.ends_at_knot:
        defects.append(right[: 2 * n] - start - h * sum(b * f for b, f in zip(tableau.b, rates, strict=True)))
    defects.append(right[2 * n] - left[2 * n])

    square = sum(b * ca.dot(weights, torque**2) for b, torque in zip(tableau.b, one.torques, strict=True))
    cost = fraction * left[2 * n] * (1 + square / 2)
    return one.y, one.p, ca.vertcat(*defects), cost


def stage_accelerations(dynamics: Dynamics, scheme: Scheme) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Unknowns and parameters of one interval, and the accelerations over speed/T at its stages, a column each."""
    one = _interval(dynamics, scheme)
    return one.y, one.p, ca.horzcat(*one.accelerations) * one.p[1] / one.p[3]


@dataclass(frozen=True, kw_only=True)
class Program:
    """A nonlinear program with its exact derivatives, ready for `casadi.nlpsol`.

    Attributes:
        functions: x, p, f, g for nlpsol.
        jacobian: (x, p) -> (g, ∂g/∂x).
        hessian: (x, p, σ, λ) -> upper triangle of ∂²(σ f + λᵀg)/∂x².
    """

    functions: dict[str, ca.MX]
    jacobian: ca.Function
    hessian: ca.Function


@dataclass(frozen=True, kw_only=True)
class Nlp(Program):
    """The program of a layout.

    Attributes:
        layout: where what stands.
        intervals: their number N.
        gradient: (x, p) -> ∂f/∂x.
        defects: equations per interval.
    """

    layout: Layout
    intervals: int
    gradient: ca.Function
    defects: int


def build_nlp(dynamics: Dynamics, scheme: Scheme, intervals: int) -> Nlp:
    """The NLP of an arm: depends on the model and the mesh's size only, not on poses, limits, scales or payload.

    Args:
        dynamics: with a free last body.
        scheme: how motion becomes unknowns.
        intervals: their number N.

    Parameters p: interval fractions (N), scales of T, q, v, effort weights (nv), torque scales (nv), the last
    body's dynamic parameters (10).
    """
    layout, one = Layout(dynamics.nv, scheme), interval_functions(dynamics, scheme)
    block, width = layout.knot + layout.inner, 2 * layout.knot + layout.inner
    # The unknowns of interval k: its own block and the next knot.
    index = block * np.arange(intervals)[None, :] + np.arange(width)[:, None]
    program, _ = mapped(one, index, layout.size(intervals), dynamics.nv)
    x, p, f = (program.functions[name] for name in "xpf")
    return Nlp(
        functions=program.functions,
        jacobian=program.jacobian,
        hessian=program.hessian,
        layout=layout,
        intervals=intervals,
        gradient=ca.Function("gradient", [x, p], [ca.gradient(f, x)]),
        defects=one.defects.numel_out(0),
    )


def mapped(one: "IntervalFunctions", index: Index, size: int, joints: int) -> tuple[Program, tuple[ca.MX, ca.MX]]:
    """The program of many intervals.

    Args:
        one: an interval.
        index: which unknowns are an interval's, a column each.
        size: number of all unknowns.
        joints: of the arm.

    Returns:
        The program, and the intervals' unknowns and parameters, a column each.
    """
    (width, N), rows = index.shape, one.defects.numel_out(0)
    x, p = ca.MX.sym("x", size), ca.MX.sym("p", N + parameters_of(joints))
    y = ca.reshape(x[index.ravel(order="F").tolist()], width, N)
    parameters = ca.vertcat(p[:N].T, ca.repmat(p[N:], 1, N))
    g = ca.vec(one.defects.map(N)(y, parameters))
    f = ca.sum2(one.cost.map(N)(y, parameters))

    row, col = (np.array(place, dtype=int) for place in one.jacobian_pattern.get_triplet())
    nonzeros = one.jacobian.map(N)(y, parameters)
    jacobian = scatter(row[:, None] + rows * np.arange(N), index[col], (rows * N, size), nonzeros)

    sigma, lam = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", rows * N)
    row, col = (np.array(place, dtype=int) for place in one.hessian_pattern.get_triplet())
    nonzeros = one.hessian.map(N)(y, parameters, ca.repmat(sigma, 1, N), ca.reshape(lam, rows, N))
    hessian = scatter(index[row], index[col], (size, size), nonzeros)
    program = Program(
        functions={"x": x, "p": p, "f": f, "g": g},
        jacobian=jacobian_function(x, p, g, jacobian),
        hessian=hessian_function(x, p, sigma, lam, hessian),
    )
    return program, (y, parameters)


def jacobian_function(x: ca.MX, p: ca.MX, g: ca.MX, jacobian: ca.MX) -> ca.Function:
    """As nlpsol wants it."""
    return ca.Function("nlp_jac_g", [x, p], [g, jacobian], ["x", "p"], ["g", "jac_g_x"])


def hessian_function(x: ca.MX, p: ca.MX, sigma: ca.MX, lam: ca.MX, hessian: ca.MX) -> ca.Function:
    """As nlpsol wants it."""
    names = ["x", "p", "lam_f", "lam_g"], ["triu_hess_gamma_x_x"]
    return ca.Function("nlp_hess_l", [x, p, sigma, lam], [hessian], *names)


def assemble(pattern: ca.Sparsity, step: tuple[int, int], shape: tuple[int, int], nonzeros: ca.MX) -> ca.MX:
    """The sparse matrix of which every interval has the same pattern, `step` further down and right.

    Args:
        pattern: of one interval.
        step: rows and columns from one interval to the next.
        shape: of the whole.
        nonzeros: a column per interval; what falls on the same place is added.
    """
    shift = np.arange(nonzeros.shape[1])
    row, col = (np.array(x, dtype=int) for x in pattern.get_triplet())
    return scatter(row[:, None] + step[0] * shift, col[:, None] + step[1] * shift, shape, nonzeros)


def scatter(rows: Index, cols: Index, shape: tuple[int, int], nonzeros: ca.MX) -> ca.MX:
    """The sparse matrix of nonzeros, each in its row and column; what falls on the same place is added."""
    rows, cols = rows.ravel(order="F"), cols.ravel(order="F")
    places, which = np.unique(cols * shape[0] + rows, return_inverse=True)  # column by column, as CasADi stores
    sparsity = ca.Sparsity.triplet(*shape, (places % shape[0]).tolist(), (places // shape[0]).tolist())
    gather = ca.Sparsity.triplet(places.size, rows.size, which.tolist(), list(range(rows.size)))
    return ca.MX(sparsity, ca.mtimes(ca.MX(ca.DM(gather, 1.0)), ca.vec(nonzeros)))


@dataclass(frozen=True)
class IntervalFunctions:
    """One interval's values and the nonzeros of its derivatives."""

    defects: ca.Function
    cost: ca.Function
    jacobian: ca.Function
    jacobian_pattern: ca.Sparsity
    hessian: ca.Function
    hessian_pattern: ca.Sparsity


@built_once(maxsize=16)
def interval_functions(dynamics: Dynamics, scheme: Scheme) -> IntervalFunctions:
    """The functions of one interval; the same model and scheme give the same ones."""
    return differentiated("interval", *_equations(dynamics, scheme), scheme.compile)


def differentiated(name: str, y: ca.SX, p: ca.SX, defects: ca.SX, cost: ca.SX, asked: bool | None) -> IntervalFunctions:
    """An interval's equations as functions, with their derivatives.

    Args:
        name: the functions' names begin so.
        y: its unknowns.
        p: its parameters.
        defects: its equations.
        cost: its part of the cost.
        asked: for `compiled`.
    """
    sigma, lam = ca.SX.sym("sigma"), ca.SX.sym("lam", defects.numel())
    jacobian = ca.jacobian(defects, y)
    hessian = ca.triu(ca.hessian(sigma * cost + ca.dot(lam, defects), y)[0])
    derivatives = (
        ca.Function(f"{name}_jacobian", [y, p], [nonzeros_of(jacobian)]),
        ca.Function(f"{name}_hessian", [y, p, sigma, lam], [nonzeros_of(hessian)]),
    )
    fast = compiled(derivatives, asked)
    return IntervalFunctions(
        defects=ca.Function(f"{name}_defects", [y, p], [defects]),
        cost=ca.Function(f"{name}_cost", [y, p], [cost]),  # apart: its gradient needs no dynamics
        jacobian=fast[0],
        jacobian_pattern=jacobian.sparsity(),
        hessian=fast[1],
        hessian_pattern=hessian.sparsity(),
    )


def nonzeros_of(matrix: ca.SX) -> ca.SX:
    """The nonzeros of a matrix as a dense column."""
    column = ca.SX(ca.Sparsity.dense(matrix.nnz(), 1), 0)
    column.nz[:] = matrix.nz[:]
    return column
