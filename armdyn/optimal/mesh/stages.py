"""Derivatives of a condensed interval by the chain rule, in consecutive functions.

The condensed interval (see `condensed`) has forward dynamics at three points: at both ends, and in the middle that
follows from them. One expression would contain the dynamics' second derivatives many times: 23 000 instructions for
three joints. One function `second_order`, called three times, needs 7 000 instructions, a fifth of the compile time and
half of the run time. The multipliers λ of the equations give those of the accelerations at the three points.

The accelerations are expanded to second order in a change of the unknowns: the interval's derivatives are those of the
expansion at no change, by CasADi.
"""

from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.constraints.rows import nonzeros_of
from armdyn.optimal.mesh.assembly import present_body
from armdyn.optimal.mesh.layout import Parameters


@dataclass(frozen=True, eq=False)
class StageFunctions:
    """Functions of one interval; y = (x_k, u_k, x_{k+1}, T) are its unknowns, p its `Parameters`, all scaled.

    Attributes:
        rate: (x, u, p) → acceleration a.
        second_order: (x, u, weights of a, p) → a, nonzeros of its Jacobian in (x, u) and of its weighted Hessian.
        middle: (y, a at the left, a at the right, p) → the middle's state.
        weigh: (y, the middle's Jacobian, λ, ν, p) → weights of a at the left and at the right.
        equations: (y, a at the left, in the middle, at the right, p) → defects, then the cost.
        assemble: (y, λ, ν, then a, Jacobian and Hessian at the left, in the middle, at the right, p) → nonzeros of the
            defects' Jacobian, the cost's gradient, the upper triangle of the Hessian of cost + λ'defects + ν'middle,
            and the middle's Jacobian.
        jacobian: sparsity of the defects' Jacobian.
        gradient: sparsity of the cost's gradient: in the torques and T.
        hessian: sparsity of the Hessian's upper triangle.
        middle_jacobian: sparsity of the middle's Jacobian.
    """

    rate: ca.Function
    second_order: ca.Function
    middle: ca.Function
    weigh: ca.Function
    equations: ca.Function
    assemble: ca.Function
    jacobian: ca.Sparsity
    gradient: ca.Sparsity
    hessian: ca.Sparsity
    middle_jacobian: ca.Sparsity

    @property
    def functions(self) -> tuple[ca.Function, ...]:
        """All functions."""
        return self.rate, self.second_order, self.middle, self.weigh, self.equations, self.assemble

    @classmethod
    def of(cls, dynamics: Dynamics) -> Self:
        """Make the functions for an arm with constant torques in the intervals.

        Args:
            dynamics: dynamics with a symbolic last body.
        """
        n = dynamics.nv
        p, y, change = (ca.SX.sym(*each) for each in (("p", Parameters.size(n)), ("y", 5 * n + 1), ("d", 5 * n + 1)))
        lam, nu, by = ca.SX.sym("lam", 2 * n), ca.SX.sym("nu", 2 * n), Parameters.of(p, n)
        rate, second_order, jacobian, hessian = _acceleration(dynamics, p, by)
        a, jacobians, hessians = (
            [ca.SX.sym(f"{part}_{point}", size) for point in "lmr"]
            for part, size in (("a", n), ("jacobian", jacobian.nnz()), ("hessian", hessian.nnz()))
        )
        (start, u, end, T), (d_start, d_u, d_end, d_T) = (
            (each[: 2 * n], each[2 * n : 3 * n], each[3 * n : 5 * n], each[-1]) for each in (y, change)
        )
        dh, pace = by.fraction * by.time, by.speed / by.length
        h = dh * (T + d_T)

        def moved(k: int, state: ca.SX) -> ca.SX:
            """Change of the rate F = (q', v') at a point by a change of its state, and of the torque."""
            return ca.vertcat(pace * state[n:], ca.SX(jacobian, jacobians[k]) @ ca.vertcat(state, d_u))

        # x_m = (x_k + x_{k+1}) / 2 + h / 8 (F_l - F_r)
        fall = ca.vertcat(pace * (start - end)[n:], a[0] - a[2])
        middle = (start + end) / 2 + dh * T / 8 * fall
        d_middle = (d_start + d_end) / 2 + dh * d_T / 8 * fall + h / 8 * (moved(0, d_start) - moved(2, d_end))
        total, curvature = ca.SX(2 * n, 1), ca.SX(5 * n + 1, 5 * n + 1)  # F_l + 4 F_m + F_r, and its accelerations'
        for k, (state, own, weight) in enumerate(((start, d_start, 1), (middle, d_middle, 4), (end, d_end, 1))):
            total += weight * (ca.vertcat(pace * state[n:], a[k]) + moved(k, own))
            way = ca.jacobian(ca.vertcat(own, d_u), change)
            curvature += weight * way.T @ ca.triu2symm(ca.SX(hessian, hessians[k])) @ way
        defects = end + d_end - start - d_start - h / 6 * total
        cost = by.fraction * (T + d_T) * (1 + ca.dot(by.weights, (u + d_u) ** 2) / 2)
        lagrangian = cost + ca.dot(lam, defects) + ca.dot(nu, d_middle)
        bent = ca.triu(ca.hessian(lagrangian, change)[0] - dh * T / 6 * curvature)
        derivatives = [*(ca.jacobian(each, change) for each in (defects, cost)), bent, ca.jacobian(d_middle, change)]
        here, nothing = [ca.vertcat(defects, cost), *derivatives], ca.DM.zeros(5 * n + 1)
        values, *derivatives = (ca.sparsify(each) for each in ca.substitute(here, [change], [nothing]))
        # Of the middle's correction: h / 8 over -h / 6 is -3 / 4.
        through = ca.gradient(ca.dot(lam, moved(1, d_start)), change)[: 2 * n]
        correction = dh * T / 2 * through - 3 / 4 * nu
        points = [each for point in zip(a, jacobians, hessians, strict=True) for each in point]
        nonzeros = [nonzeros_of(each) for each in derivatives]
        return cls(
            rate=rate,
            second_order=second_order,
            middle=ca.Function("middle", [y, a[0], a[2], p], [middle]),
            weigh=ca.Function("weigh", [y, jacobians[1], lam, nu, p], [lam[n:] + s * correction[n:] for s in (1, -1)]),
            equations=ca.Function("equations", [y, *a, p], [ca.densify(values)]),
            assemble=ca.Function("assemble", [y, lam, nu, *points, p], _shared(nonzeros)),
            jacobian=derivatives[0].sparsity(),
            gradient=derivatives[1].T.sparsity(),
            hessian=derivatives[2].sparsity(),
            middle_jacobian=derivatives[3].sparsity(),
        )


def _acceleration(
    dynamics: Dynamics, p: ca.SX, by: Parameters
) -> tuple[ca.Function, ca.Function, ca.Sparsity, ca.Sparsity]:
    """`rate` and `second_order` of the scaled acceleration, and the sparsity of its Jacobian and Hessian."""
    n, body = dynamics.nv, present_body(dynamics, p)
    x, u, weights = ca.SX.sym("x", 2 * n), ca.SX.sym("u", n), ca.SX.sym("weights", n)
    a, at = dynamics.aba(by.length * x[:n], by.speed * x[n:], by.effort * u, body) / by.speed, ca.vertcat(x, u)
    jacobian, hessian = ca.jacobian(a, at), ca.triu(ca.hessian(ca.dot(weights, a), at)[0])
    columns = _shared([a, nonzeros_of(jacobian), nonzeros_of(hessian)])
    second_order = ca.Function("second_order", [x, u, weights, p], columns)
    return ca.Function("rate", [x, u, p], [a]), second_order, jacobian.sparsity(), hessian.sparsity()


def _shared(columns: list[ca.SX]) -> list[ca.SX]:
    """Rewrite columns so that common subexpressions are computed once."""
    ends = np.cumsum([0] + [column.numel() for column in columns]).tolist()
    return list(ca.vertsplit(ca.cse(ca.vertcat(*columns)), ends))
