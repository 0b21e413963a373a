"""Derivatives of a condensed interval by the chain rule, in consecutive functions.

The condensed interval (see `condensed`) has forward dynamics at three points: at both ends, and in the middle that
follows from them. One expression would contain the dynamics' second derivatives many times: 23 000 instructions for
three joints. One function `second_order`, called three times, needs 7 000 instructions, a fifth of the compile time and
half of the run time. The multipliers λ of the equations give those of the accelerations at the three points.
"""

from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.constraints.rows import nonzeros_of
from armdyn.optimal.mesh.interval import present_body
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
        gradient: sparsity of the cost's gradient.
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
        p, y = ca.SX.sym("p", Parameters.size(n)), ca.SX.sym("y", 5 * n + 1)
        lam, nu = ca.SX.sym("lam", 2 * n), ca.SX.sym("nu", 2 * n)
        acceleration, one = _Acceleration.of(dynamics, p), _Interval.of(n, Parameters.of(p, n), y)
        left, middle, right = (_Point.of(name, acceleration, one) for name in "lmr")
        jacobian, hessian, moved = one.derivatives(left, middle, right, lam, nu)
        gradient = ca.gradient(one.cost, y)
        nonzeros = [nonzeros_of(part) for part in (jacobian, gradient, hessian, moved)]
        given = [part for point in (left, middle, right) for part in (point.a, point.jacobians, point.hessians)]
        # Of the middle's correction: h / 8 over -h / 6 is -3 / 4.
        correction = one.h / 2 * middle.weighed(lam) - 3 / 4 * nu
        weights = [lam[n:] + sign * correction[n:] for sign in (1, -1)]
        equations = ca.vertcat(one.defects(left, middle, right), one.cost)
        return cls(
            rate=acceleration.rate,
            second_order=acceleration.second_order,
            middle=ca.Function("middle", [y, left.a, right.a, p], [one.middle(left, right)]),
            weigh=ca.Function("weigh", [y, middle.jacobians, lam, nu, p], weights),
            equations=ca.Function("equations", [y, left.a, middle.a, right.a, p], [equations]),
            assemble=ca.Function("assemble", [y, lam, nu, *given, p], _shared(nonzeros)),
            jacobian=jacobian.sparsity(),
            gradient=gradient.sparsity(),
            hessian=hessian.sparsity(),
            middle_jacobian=moved.sparsity(),
        )


def _shared(columns: list[ca.SX]) -> list[ca.SX]:
    """Rewrite columns so that common subexpressions are computed once."""
    ends = np.cumsum([0] + [column.numel() for column in columns]).tolist()
    return list(ca.vertsplit(ca.cse(ca.vertcat(*columns)), ends))


@dataclass(frozen=True, eq=False)
class _Acceleration:
    """Scaled acceleration of a state and a torque: `rate` and `second_order`, and the sparsity of its derivatives."""

    rate: ca.Function
    second_order: ca.Function
    jacobians: ca.Sparsity
    hessians: ca.Sparsity

    @classmethod
    def of(cls, dynamics: Dynamics, p: ca.SX) -> Self:
        n, by = dynamics.nv, Parameters.of(p, dynamics.nv)
        x, u, weights = ca.SX.sym("x", 2 * n), ca.SX.sym("u", n), ca.SX.sym("weights", n)
        body = present_body(dynamics, p)
        a = dynamics.aba(by.length * x[:n], by.speed * x[n:], by.effort * u, body) / by.speed
        at = ca.vertcat(x, u)
        jacobians, hessians = ca.jacobian(a, at), ca.triu(ca.hessian(ca.dot(weights, a), at)[0])
        second_order = ca.Function(
            "second_order", [x, u, weights, p], _shared([a, nonzeros_of(jacobians), nonzeros_of(hessians)])
        )
        return cls(ca.Function("rate", [x, u, p], [a]), second_order, jacobians.sparsity(), hessians.sparsity())


@dataclass(frozen=True, eq=False)
class _Point:
    """A point of the interval in symbols, with derivatives to second order.

    Attributes:
        a: acceleration.
        jacobians: nonzeros of the acceleration's Jacobian in (x, u).
        hessians: nonzeros of the upper triangle of its weighted Hessian.
        by_state: ∂F/∂x of the state's rate F = (q', v').
        by_torque: ∂F/∂u.
        curvature: weighted Hessian of F in (x, u).
    """

    a: ca.SX
    jacobians: ca.SX
    hessians: ca.SX
    by_state: ca.SX
    by_torque: ca.SX
    curvature: ca.SX

    @classmethod
    def of(cls, name: str, acceleration: _Acceleration, one: "_Interval") -> Self:
        n = one.n
        a, jacobians, hessians = (
            ca.SX.sym(f"{name}_{part}", size)
            for part, size in (
                ("a", n),
                ("jacobian", acceleration.jacobians.nnz()),
                ("hessian", acceleration.hessians.nnz()),
            )
        )
        jacobian = ca.SX(acceleration.jacobians, jacobians)
        above = ca.horzcat(ca.SX(n, n), one.pace * ca.SX.eye(n))
        by_state = ca.vertcat(above, jacobian[:, : 2 * n])
        by_torque = ca.vertcat(ca.SX(n, n), jacobian[:, 2 * n :])
        return cls(a, jacobians, hessians, by_state, by_torque, ca.triu2symm(ca.SX(acceleration.hessians, hessians)))

    def weighed(self, lam: ca.SX) -> ca.SX:
        """Gradient of λ'F in the state."""
        gradient: ca.SX = self.by_state.T @ lam
        return gradient


@dataclass(frozen=True, eq=False)
class _Interval:
    """Unknowns of an interval in symbols, all scaled.

    Attributes:
        n: number of joints.
        start: x_k.
        end: x_{k+1}.
        h: duration of the interval.
        dh: dh/dT, with the final time T.
        pace: rate of the scaled position per scaled velocity.
        cost: cost of the interval.
        y: all unknowns.
    """

    n: int
    start: ca.SX
    end: ca.SX
    h: ca.SX
    dh: ca.SX
    pace: ca.SX
    cost: ca.SX
    y: ca.SX

    @classmethod
    def of(cls, n: int, by: Parameters, y: ca.SX) -> Self:
        """Symbols of an interval from its unknowns y, with the scales `by`."""
        u, T, dh = y[2 * n : 3 * n], y[-1], by.fraction * by.time
        cost = by.fraction * T * (1 + ca.dot(by.weights, u**2) / 2)
        return cls(n, y[: 2 * n], y[3 * n : 5 * n], dh * T, dh, by.speed / by.length, cost, y)

    def rate(self, x: ca.SX, a: ca.SX) -> ca.SX:
        """F = (q', v')."""
        rate: ca.SX = ca.vertcat(self.pace * x[self.n :], a)
        return rate

    def fall(self, left: _Point, right: _Point) -> ca.SX:
        """Decrease of F from the left to the right end."""
        return self.rate(self.start, left.a) - self.rate(self.end, right.a)

    def middle(self, left: _Point, right: _Point) -> ca.SX:
        """The middle's state x_m = (x_k + x_{k+1}) / 2 + h / 8 (F_l - F_r)."""
        return (self.start + self.end) / 2 + self.h / 8 * self.fall(left, right)

    def total(self, left: _Point, middle: _Point, right: _Point) -> ca.SX:
        """Simpson's sum F_l + 4 F_m + F_r."""
        ends = self.rate(self.start, left.a) + self.rate(self.end, right.a)
        return ends + 4 * self.rate(self.middle(left, right), middle.a)

    def defects(self, left: _Point, middle: _Point, right: _Point) -> ca.SX:
        """x_{k+1} - x_k - h / 6 (F_l + 4 F_m + F_r)."""
        return self.end - self.start - self.h / 6 * self.total(left, middle, right)

    def derivatives(
        self, left: _Point, middle: _Point, right: _Point, lam: ca.SX, nu: ca.SX
    ) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Jacobian of the defects, upper triangle of the Hessian of cost + λ'defects + ν'x_m, Jacobian of x_m.

        The Hessian consists of F's at the three points, each with its weights, in the directions by which y moves the
        points, and of the mixed terms with T, as h = dh T multiplies every F.

        Args:
            left: left end, with the Hessian for the weights of `weigh`.
            middle: middle, with the Hessian for the weights λ.
            right: right end, as the left one.
            lam: λ, of the defects.
            nu: ν, of the middle's state x_m.
        """
        n, h, dh = self.n, self.h, self.dh
        zero, one = ca.SX(2 * n, 2 * n), ca.SX.eye(2 * n)
        # Jacobians of F in y at the three points, shape (2 n, 5 n + 1).
        to_left = ca.horzcat(left.by_state, left.by_torque, zero, ca.SX(2 * n, 1))
        to_right = ca.horzcat(zero, right.by_torque, right.by_state, ca.SX(2 * n, 1))
        along_T = ca.horzcat(ca.SX(1, 5 * n), ca.SX.eye(1))
        ends = ca.horzcat(one, ca.SX(2 * n, n), one, ca.SX(2 * n, 1)) / 2
        moved = ends + h / 8 * (to_left - to_right) + dh / 8 * self.fall(left, right) @ along_T
        torque = ca.horzcat(ca.SX(n, 2 * n), ca.SX.eye(n), ca.SX(n, 2 * n + 1))
        to_middle = middle.by_state @ moved + middle.by_torque @ torque
        jacobian_sum = to_left + 4 * to_middle + to_right
        change = ca.horzcat(-one, ca.SX(2 * n, n), one, ca.SX(2 * n, 1))
        jacobian = change - h / 6 * jacobian_sum - dh / 6 * self.total(left, middle, right) @ along_T

        state = ca.horzcat(one, ca.SX(2 * n, 3 * n + 1))
        last = ca.horzcat(ca.SX(2 * n, 3 * n), one, ca.SX(2 * n, 1))
        points = ((left, state, 1), (middle, moved, 4), (right, last, 1))
        curvature = ca.hessian(self.cost, self.y)[0]
        for point, way, weight in points:
            at = ca.vertcat(way, torque)
            curvature -= weight * h / 6 * (at.T @ point.curvature @ at)
        correction = dh / 8 * nu - h * dh / 12 * middle.weighed(lam)
        mixed = -dh / 6 * lam.T @ jacobian_sum + correction.T @ (to_left - to_right)
        shared = along_T.T @ mixed
        hessian = ca.triu(ca.sparsify(curvature + shared + shared.T))
        return ca.sparsify(jacobian), hessian, ca.sparsify(moved)
