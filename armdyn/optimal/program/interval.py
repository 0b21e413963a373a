"""One interval of direct collocation: equations, cost and derivatives."""

from dataclasses import dataclass
from typing import Protocol

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.codegen.compiled import compiled
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.program.layout import Layout, Parameters
from armdyn.optimal.task.tableau import Scheme


@dataclass(frozen=True)
class _ScaledStages:
    """One interval: unknowns y = (knot, inner, next knot), parameters p, states and torques at its stages."""

    y: ca.SX
    p: ca.SX
    states: list[ca.SX]
    torques: list[ca.SX]
    velocities: list[ca.SX]
    accelerations: list[ca.SX]


def _scaled_stages(dynamics: Dynamics, scheme: Scheme) -> _ScaledStages:
    """Scaled states and torques, velocities, accelerations [rad/s²]."""
    n, tableau, layout = dynamics.nv, scheme.tableau, Layout(dynamics.nv, scheme)
    y, p = ca.SX.sym("y", layout.width), ca.SX.sym("p", Parameters.size(n))
    by, body = Parameters.of(p, n), present_body(dynamics, p)
    left, inner, right = layout.parts(y)

    first = [left[layout.knot.state]] if tableau.starts_at_knot else []
    states = [*first, *ca.vertsplit(inner[layout.inner.states], 2 * n), right[layout.knot.state]]
    if scheme.control == "linear":
        u = [(1 - c) * left[layout.knot.torque] + c * right[layout.knot.torque] for c in tableau.c]
    else:
        own = ca.vertsplit(inner[layout.inner.torques], n)
        u = own if scheme.control == "stage" else own * tableau.c.size

    velocities, accelerations = [], []
    for x, torque in zip(states, u, strict=True):
        q, v = by.length * x[layout.knot.q], by.speed * x[layout.knot.v]
        velocities.append(v)
        accelerations.append(dynamics.aba(q, v, by.effort * torque, body))
    return _ScaledStages(y, p, states, u, velocities, accelerations)


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


def _equations(dynamics: Dynamics, scheme: Scheme) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
    """Unknowns, parameters, defects and cost of one interval, all scaled."""
    n, tableau, layout, one = dynamics.nv, scheme.tableau, Layout(dynamics.nv, scheme), _scaled_stages(dynamics, scheme)
    by, (left, _, right) = Parameters.of(one.p, n), layout.parts(one.y)
    start, duration = left[layout.knot.state], left[layout.knot.time]
    scale = ca.vertcat(ca.repmat(by.length, n, 1), ca.repmat(by.speed, n, 1))
    h = by.fraction * by.time * duration
    rates = [ca.vertcat(v, a) / scale for v, a in zip(one.velocities, one.accelerations, strict=True)]
    defects = []
    for i in range(tableau.c.size):
        if np.any(tableau.A[i]):
            rise = sum(tableau.A[i, j] * rates[j] for j in range(tableau.c.size))
            defects.append(one.states[i] - start - h * rise)
    defects.append(right[layout.knot.time] - duration)

    square = sum(b * ca.dot(by.weights, torque**2) for b, torque in zip(tableau.b, one.torques, strict=True))
    cost = by.fraction * duration * (1 + square / 2)
    return one.y, one.p, ca.vertcat(*defects), cost


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
        layout, one = Layout(self.dynamics.nv, self.scheme), _scaled_stages(self.dynamics, self.scheme)
        by, (left, _, _) = Parameters.of(one.p, self.dynamics.nv), layout.parts(one.y)
        return Stages(
            y=one.y,
            p=one.p,
            h=by.fraction * by.time * left[layout.knot.time],
            c=self.scheme.tableau.c,
            q=ca.horzcat(*(by.length * x[layout.knot.q] for x in one.states)),
            v=ca.horzcat(*one.velocities),
            a=ca.horzcat(*one.accelerations),
            tau=ca.horzcat(*(by.effort * torque for torque in one.torques)),
            acceleration=by.speed / by.time,
            effort=by.effort,
            dynamics=self.dynamics,
        )


@dataclass(frozen=True)
class IntervalFunctions:
    """Equations of one interval and the nonzeros of their derivatives; cost is None without a cost."""

    defects: ca.Function
    cost: ca.Function | None
    jacobian: ca.Function
    jacobian_pattern: ca.Sparsity
    hessian: ca.Function
    hessian_pattern: ca.Sparsity


@built_once(maxsize=16)
def interval_functions(dynamics: Dynamics, scheme: Scheme) -> IntervalFunctions:
    """Functions of one interval; cached by model and scheme."""
    return differentiated("interval", *_equations(dynamics, scheme), scheme.compile)


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
