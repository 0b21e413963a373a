"""From an arm to a nonlinear program: the equations of one interval, mapped to a mesh, with exact derivatives.

The final time is copied to every knot (see `layout`), so that the Jacobian is block bidiagonal and the Hessian
block tridiagonal. One interval is differentiated symbolically, once, and mapped N times: building costs the same
for ten intervals and for a thousand.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.program.interval import IntervalFunctions, interval_functions
from armdyn.optimal.program.layout import Layout, Parameters
from armdyn.optimal.task.scheme import Scheme

Index = NDArray[np.int_]


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
    """

    layout: Layout
    intervals: int
    gradient: ca.Function

    @property
    def defects(self) -> int:
        """Equations of motion per interval."""
        return self.layout.equations.size


def build_nlp(dynamics: Dynamics, scheme: Scheme, intervals: int) -> Nlp:
    """The NLP of an arm: depends on the model and the mesh's size only, not on poses, limits, scales or payload.

    Args:
        dynamics: with a free last body.
        scheme: how motion becomes unknowns.
        intervals: their number N.

    Its parameters are `Parameters`, those of all intervals at once.
    """
    layout, one = Layout(dynamics.nv, scheme), interval_functions(dynamics, scheme)
    program, _ = mapped(one, layout.intervals(intervals), layout.size(intervals), dynamics.nv)
    x, p, f = (program.functions[name] for name in "xpf")
    return Nlp(
        functions=program.functions,
        jacobian=program.jacobian,
        hessian=program.hessian,
        layout=layout,
        intervals=intervals,
        gradient=ca.Function("gradient", [x, p], [ca.gradient(f, x)]),
    )


def mapped(one: IntervalFunctions, index: Index, size: int, joints: int) -> tuple[Program, tuple[ca.MX, ca.MX]]:
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
    x, p = ca.MX.sym("x", size), ca.MX.sym("p", Parameters.size(joints, N))
    y = ca.reshape(x[index.ravel(order="F").tolist()], width, N)
    parameters = Parameters.by_interval(p, N)
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


def scatter(rows: Index, cols: Index, shape: tuple[int, int], nonzeros: ca.MX) -> ca.MX:
    """The sparse matrix of nonzeros, each in its row and column; what falls on the same place is added."""
    rows, cols = rows.ravel(order="F"), cols.ravel(order="F")
    places, which = np.unique(cols * shape[0] + rows, return_inverse=True)  # column by column, as CasADi stores
    sparsity = ca.Sparsity.triplet(*shape, (places % shape[0]).tolist(), (places // shape[0]).tolist())
    gather = ca.Sparsity.triplet(places.size, rows.size, which.tolist(), list(range(rows.size)))
    return ca.MX(sparsity, ca.mtimes(ca.MX(ca.DM(gather, 1.0)), ca.vec(nonzeros)))
