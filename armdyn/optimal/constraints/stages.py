"""The place at which rows of a program are written: one interval in symbols, and its derivatives."""

from dataclasses import dataclass
from typing import Protocol

import casadi as ca

from armdyn.arrays import Array
from armdyn.codegen.compiled import compiled
from armdyn.dynamics.symbolic import Dynamics


@dataclass(frozen=True, eq=False)
class Stages:
    """One interval in SI units, one column per stage, both knots included, for path constraints.

    Attributes:
        y: unknowns of the interval.
        p: parameters of the interval.
        h: duration of the interval [s].
        c: nodes of the stages in the interval.
        q: joint positions [rad or m], shape (nv, stages).
        v: velocities [rad/s or m/s], likewise.
        a: accelerations [rad/s² or m/s²], likewise.
        tau: torques [N m or N], likewise.
        acceleration: scale of accelerations [rad/s² or m/s²].
        effort: scales of torques [N m or N], shape (nv,).
        dynamics: dynamics of the robot.
    """

    y: ca.SX
    p: ca.SX
    h: ca.SX
    c: Array
    q: ca.SX
    v: ca.SX
    a: ca.SX
    tau: ca.SX
    acceleration: ca.SX
    effort: ca.SX
    dynamics: Dynamics


class IntervalView(Protocol):
    """An interval of a program for path constraints; equal ones share their functions.

    Attributes:
        compile: whether its derivatives become machine code, see `compiled`.
    """

    @property
    def compile(self) -> bool | None: ...

    def stages(self) -> Stages:
        """The interval's stages in symbols."""
        ...

    def __hash__(self) -> int: ...


@dataclass(frozen=True)
class IntervalFunctions:
    """Equations of one interval and the nonzeros of their derivatives; cost is None without a cost."""

    defects: ca.Function
    cost: ca.Function | None
    jacobian: ca.Function
    jacobian_pattern: ca.Sparsity
    hessian: ca.Function
    hessian_pattern: ca.Sparsity


def differentiated(
    name: str,
    y: ca.SX,
    p: ca.SX,
    defects: ca.SX,
    cost: ca.SX | None,
    compile_mode: bool | None,
    through: tuple[ca.SX, ca.SX] | None = None,
) -> IntervalFunctions:
    """An interval's equations as functions, with their derivatives.

    Args:
        name: prefix of the functions' names.
        y: unknowns of the interval.
        p: parameters of the interval.
        defects: equations of the interval.
        cost: the interval's part of the cost; None: no cost, and common subexpressions of the derivatives are computed
            once.
        compile_mode: mode for `compiled`.
        through: intermediate symbols, on which the equations depend instead of the unknowns, and their expressions;
            only without a cost. Fewer than the unknowns, they make much smaller derivatives.
    """
    sigma, lam = ca.SX.sym("sigma"), ca.SX.sym("lam", defects.numel())
    if through is not None:
        jacobian, hessian, defects = _chained(defects, lam, y, *through)
    else:
        jacobian, shared = ca.jacobian(defects, y), ca.dot(lam, defects)
        hessian = ca.hessian(shared if cost is None else sigma * cost + shared, y)[0]
    hessian = ca.triu(hessian)
    if cost is None and through is None:
        jacobian, hessian = ca.cse(jacobian), ca.cse(hessian)
    derivatives = (
        ca.Function(f"{name}_jacobian", [y, p], [nonzeros_of(jacobian)]),
        ca.Function(f"{name}_hessian", [y, p, sigma, lam], [nonzeros_of(hessian)]),
    )
    fast = compiled(derivatives, compile_mode)
    return IntervalFunctions(
        defects=ca.Function(f"{name}_defects", [y, p], [defects]),
        # The cost separately: its gradient needs no dynamics.
        cost=None if cost is None else ca.Function(f"{name}_cost", [y, p], [cost]),
        jacobian=fast[0],
        jacobian_pattern=jacobian.sparsity(),
        hessian=fast[1],
        hessian_pattern=hessian.sparsity(),
    )


def _chained(equations: ca.SX, lam: ca.SX, y: ca.SX, x: ca.SX, inner: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Jacobian and Hessian of equations in x = inner(y) by the chain rule, and the equations in y."""
    used = sorted(set(ca.jacobian_sparsity(equations, x).get_col()))
    x, inner = x[used], inner[used]
    jacobian, (hessian, gradient) = ca.jacobian(equations, x), ca.hessian(ca.dot(lam, equations), x)
    jacobian, hessian, gradient, equations = ca.substitute(
        ca.cse([jacobian, hessian, gradient, equations]), [x], [inner]
    )
    inner_jacobian, weights = ca.jacobian(inner, y), ca.SX.sym("weights", len(used))
    inner_hessian = ca.substitute(ca.hessian(ca.dot(weights, inner), y)[0], weights, gradient)
    return jacobian @ inner_jacobian, inner_jacobian.T @ hessian @ inner_jacobian + inner_hessian, equations


def nonzeros_of(matrix: ca.SX) -> ca.SX:
    """Nonzeros of a matrix as a dense column."""
    column = ca.SX(ca.Sparsity.dense(matrix.nnz(), 1), 0)
    column.nz[:] = matrix.nz[:]
    return column
