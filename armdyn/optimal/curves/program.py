"""Nonlinear program of B-spline motions: inverse dynamics at points, limits of derivatives, continuity between legs."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.arrays import Array, Index
from armdyn.codegen.compiled import compiled
from armdyn.codegen.deadline import expect_time
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.constraints.rows import IntervalFunctions, StageRows, Stages, differentiated, nonzeros_of
from armdyn.optimal.constraints.torque_limits import TorqueSpeedLimit
from armdyn.optimal.curves.curve import WINDOW
from armdyn.optimal.curves.layout import POINTS, CurveLayout
from armdyn.optimal.mesh.assembly import Block, Program, only_present, program_of
from armdyn.optimal.mesh.layout import BODY
from armdyn.optimal.problem.problem import MinimumTimeProblem


@dataclass(frozen=True)
class Shared:
    """Parameters common to all equations of a curve, in symbols or numbers.

    Attributes:
        effort: scales of the torques: half their ranges [N m or N], shape (nv,).
        weights: weights of the squared scaled torques over time, shape (nv,).
        body: dynamic parameters of the body on the last joint, shape (10,).
        travel: scales of dq/ds, s being the part of the time, where it has a cost [rad or m], shape (nv,).
        time_cost: cost of a second.
    """

    effort: ca.SX
    weights: ca.SX
    body: ca.SX
    travel: ca.SX
    time_cost: ca.SX

    @staticmethod
    def size(joints: int) -> int:
        return 3 * joints + BODY + 1

    @classmethod
    def symbols(cls, joints: int) -> "Shared":
        sizes = (("effort", joints), ("weights", joints), ("body", BODY), ("travel", joints), ("hurry", 1))
        return cls(*(ca.SX.sym(name, size) for name, size in sizes))

    def column(self) -> ca.SX:
        return ca.vertcat(self.effort, self.weights, self.body, self.travel, self.time_cost)


@built_once(maxsize=16)
def torque_equations(dynamics: Dynamics, compile_mode: bool | None) -> IntervalFunctions:
    """Torque at a point of the curve by inverse dynamics minus its unknown, both over half the torque's range.

    Unknowns: the control points of its window, the leg's duration T [s], the scaled torques.
    Parameters: values, first and second derivatives of the window's B-splines, shape (3, WINDOW); the point's part of
        the time; costs there of a squared torque, whatever T is, and of squared dq/ds over the scales of `Shared`; then
        `Shared`.
    The chain from control points to (q, q', q'') is linear, so that the dynamics are differentiated in these only.
    """
    n, shared = dynamics.nv, Shared.symbols(dynamics.nv)
    curve, duration, torque = ca.SX.sym("curve", 3 * n), ca.SX.sym("T"), ca.SX.sym("torque", n)
    basis, part, tie, calm = ca.SX.sym("basis", 3 * WINDOW), ca.SX.sym("part"), ca.SX.sym("tie"), ca.SX.sym("calm")
    body = only_present(dynamics, shared.body)
    q, dq, ddq = (curve[i * n : (i + 1) * n] for i in range(3))
    load = dynamics.rnea(q, dq / duration, ddq / duration**2, body) / shared.effort
    points, lam, sigma = ca.SX.sym("points", n * WINDOW), ca.SX.sym("lam", n), ca.SX.sym("sigma")
    y, p = ca.vertcat(points, duration, torque), ca.vertcat(basis, part, tie, calm, shared.column())
    chain = ca.kron(ca.reshape(basis, WINDOW, 3).T, ca.SX.eye(n))
    outer, at = ca.diagcat(chain, ca.SX.eye(1)), chain @ points
    moving = calm * ca.sumsqr(at[n : 2 * n] / shared.travel)
    effort = shared.time_cost * part * duration * ca.dot(shared.weights, torque**2)
    cost = (tie * ca.sumsqr(torque) + moving + effort) / 2
    inner = ca.vertcat(curve, duration)
    curvature = ca.hessian(ca.dot(lam, load), inner)[0]
    jacobian = ca.horzcat(ca.jacobian(load, inner) @ outer, -ca.SX.eye(n))
    paying = ca.hessian(sigma * cost, ca.vertcat(points, duration, torque))[0]
    hessian = ca.triu(ca.diagcat(outer.T @ curvature @ outer, ca.SX(n, n)) + paying)
    fast = compiled(
        (
            ca.Function("torque_jacobian", [y, p], [ca.substitute(nonzeros_of(jacobian), curve, at)]),
            ca.Function("torque_hessian", [y, p, sigma, lam], [ca.substitute(nonzeros_of(hessian), curve, at)]),
        ),
        compile_mode,
        later=True,
    )
    return IntervalFunctions(
        defects=ca.Function("torque_defects", [y, p], [ca.substitute(load, curve, at) - torque]),
        cost=ca.Function("torque_cost", [y, p], [cost]),
        jacobian=fast[0],
        jacobian_pattern=jacobian.sparsity(),
        hessian=fast[1],
        hessian_pattern=hessian.sparsity(),
    )


@built_once(maxsize=16)
def torque_step_cost(joints: int) -> IntervalFunctions:
    """Cost of the squared change of torques from one point of a leg to the next; no equations.

    Unknowns: the scaled torques at both points. Parameter: cost of a squared change.
    """
    y, price = ca.SX.sym("y", 2 * joints), ca.SX.sym("price")
    cost = price * ca.sumsqr(y[joints:] - y[:joints]) / 2
    return differentiated("torque_step", y, price, ca.SX(0, 1), cost, False)


@built_once(maxsize=16)
def rate_equations(joints: int, order: int) -> IntervalFunctions:
    """Control point of a time derivative of the curve, relative to the derivative's limits.

    Unknowns: order + 1 control points of the curve, the leg's duration T.
    Parameters: factors of these, shape (order + 1,); one over the limits, shape (nv,).
    """
    (y, factors, rates), over = _derivative(joints, order), ca.SX.sym("over", joints)
    return differentiated(f"rate{order}", y, ca.vertcat(factors, over), rates * over, None, False)


def _derivative(joints: int, order: int, leg: str = "") -> tuple[ca.SX, ca.SX, ca.SX]:
    """Unknowns and factors of `rate_equations`, and the control point of the time derivative."""
    points, duration = ca.SX.sym(f"points{leg}", joints, order + 1), ca.SX.sym(f"T{leg}")
    factors = ca.SX.sym(f"factors{leg}", order + 1)
    return ca.vertcat(ca.vec(points), duration), factors, (points @ factors) / duration**order


@built_once(maxsize=16)
def meeting_equations(joints: int, order: int) -> IntervalFunctions:
    """Time derivative at the end of a leg minus that at the start of the next leg, over its scale.

    Unknowns: order + 1 control points and the duration of one leg, then of the other.
    Parameters: factors of these points, shape (2, order + 1); one over the scale, shape (nv,).
    """
    y, factors, rates = zip(*(_derivative(joints, order, leg) for leg in ("before", "after")), strict=True)
    over = ca.SX.sym("over", joints)
    gap = (rates[0] - rates[1]) * over
    return differentiated(f"meeting{order}", ca.vertcat(*y), ca.vertcat(*factors, over), gap, None, False)


@built_once(maxsize=16)
def torque_rate_equations(joints: int, sides: int, given: bool = False) -> IntervalFunctions:
    """Torque rates between two neighbouring points, relative to the limits of the rates.

    Unknowns: the scaled torques at both points, then the durations of their legs.
    Parameters: part of each leg's duration between the points, shape (sides,); half the torque's
    range over the limit [s], shape (nv,).

    Args:
        joints: number of joints.
        sides: number of legs: 1, or 2 for points before and after a via pose.
        given: whether the first torques are parameters instead of unknowns: at the motion's ends.
    """
    before, after = ca.SX.sym("before", joints), ca.SX.sym("after", joints)
    durations, parts, over = ca.SX.sym("T", sides), ca.SX.sym("parts", sides), ca.SX.sym("over", joints)
    rates = (after - before) * over / ca.dot(parts, durations)
    y, p = ca.vertcat(after, durations), ca.vertcat(parts, over)
    y, p = (y, ca.vertcat(before, p)) if given else (ca.vertcat(before, y), p)
    return differentiated(f"torque_rate{sides}", y, p, rates, None, False)


@built_once(maxsize=16)
def torque_speed_equations(joints: int, lines: int) -> IntervalFunctions:
    """Scaled torques plus speed terms, τ + s v, for every line of the torque-speed curves at a point.

    Unknowns: as in `torque_equations`.
    Parameters: first derivatives of the window's B-splines, shape (WINDOW,); slopes s over half the torque's range
    [s/rad or s/m], shape (lines, nv).
    """
    points, duration = ca.SX.sym("points", joints, WINDOW), ca.SX.sym("T")
    torque, basis, slopes = ca.SX.sym("torque", joints), ca.SX.sym("basis", WINDOW), ca.SX.sym("slopes", joints, lines)
    used = ca.repmat(torque, 1, lines) + slopes * ca.repmat(points @ basis / duration, 1, lines)
    y, p = ca.vertcat(ca.vec(points), duration, torque), ca.vertcat(basis, ca.vec(slopes))
    return differentiated(f"torque_speed{lines}", y, p, ca.vec(used), None, False)


@dataclass(frozen=True)
class CurveInterval:
    """Interval of a curve for path constraints: stages at its ends and the Gauss points.

    Its unknowns: the window's control points, the leg's duration, the torques at the Gauss points.
    Its parameters: coefficients of the window's B-splines in powers of the part of the interval, shape
    (WINDOW, WINDOW), its part of the leg, then `Shared`.

    Attributes:
        dynamics: dynamics with a symbolic last body.
        compile: whether derivatives become machine code, see `compiled`.
    """

    dynamics: Dynamics
    compile: bool | None = None

    def stages(self) -> Stages:
        """The interval in symbols; torques are linear between and beyond the Gauss points."""
        n, shared = self.dynamics.nv, Shared.symbols(self.dynamics.nv)
        points, duration = ca.SX.sym("points", n, WINDOW), ca.SX.sym("T")
        torques, powers = ca.SX.sym("torques", n, POINTS), ca.SX.sym("powers", WINDOW, WINDOW)
        part = ca.SX.sym("part")
        h, coefficients = part * duration, points @ powers
        gauss = (np.polynomial.legendre.leggauss(POINTS)[0] + 1) / 2
        c = np.concatenate([[0.0], gauss, [1.0]])
        slope = (torques[:, 1] - torques[:, 0]) / (gauss[1] - gauss[0])
        return Stages(
            y=ca.vertcat(ca.vec(points), duration, ca.vec(torques)),
            p=ca.vertcat(ca.vec(powers), part, shared.column()),
            h=h,
            c=c,
            q=coefficients @ _powers(c, 0),
            v=coefficients @ _powers(c, 1) / h,
            a=coefficients @ _powers(c, 2) / h**2,
            tau=ca.horzcat(*((torques[:, 0] + (s - gauss[0]) * slope) * shared.effort for s in c)),
            acceleration=ca.SX(1),
            effort=shared.effort,
            dynamics=self.dynamics,
        )


def _powers(s: Array, order: int) -> Array:
    """Derivatives at s, shape (m,), of the powers below `WINDOW`, shape (WINDOW, m)."""
    return np.array([np.polynomial.Polynomial(row).deriv(order)(s) for row in np.eye(WINDOW)])


def rows_of(problem: MinimumTimeProblem, constraints: TightenedConstraints) -> tuple[StageRows, ...]:
    """Rows of the constraints that need rows of their own, apart from bounds of control points or torques."""
    own = (each for each in constraints.path_constraints if not isinstance(each, TorqueSpeedLimit))
    own = (each for each in own if each.derivative_limit(problem) is None and each.torque_rate_limit(problem) is None)
    return tuple(rows for each in own for rows in each.rows(problem))


_BUILT = 2.5e-5
"""Approximate time in which the equations of a curve are built, over the cube of the number of joints [s]."""


@built_once(maxsize=32)
def build(dynamics: Dynamics, shape: CurveLayout, rows: tuple[StageRows, ...], compile_mode: bool | None) -> Program:
    """The program of curves: torques and rates leg by leg, continuity between legs, then path constraints.

    Args:
        dynamics: dynamics with a symbolic last body.
        shape: layout of the curves.
        rows: rows of path constraints, over the intervals of all legs.
        compile_mode: mode for `compiled`.

    Raises:
        NoTimeError: it would take longer than `deadline.until` allows.
    """
    expect_time(_BUILT * shape.joints**3, f"building the equations of {shape.joints} joints")
    n, blocks, shared = shape.joints, list[Block](), Shared.size(shape.joints)
    first = shared

    def add(one: IntervalFunctions, index: Index, whole: bool = False, rows: StageRows | None = None) -> None:
        """Add equations at places, a column of unknowns each. Parameters: each place's, perhaps `Shared`, the rows'."""
        nonlocal first
        places, common = index.shape[1], 0 if rows is None else rows.size
        own = one.defects.numel_in(1) - shared * whole - common
        each = first + np.arange(own * places).reshape(places, own).T
        first += own * places + common
        same = np.concatenate([np.arange(shared * whole), np.arange(first - common, first)])
        parameters = np.vstack([each, same[:, None].repeat(places, axis=1)])
        blocks.append(Block(one, index, parameters, rows is not None and rows.where == "sum"))

    for leg in shape.legs:
        add(torque_equations(dynamics, compile_mode), shape.at_points(leg), whole=True)
        add(torque_step_cost(n), shape.torque_steps(leg)[: 2 * n])
        for order in shape.orders:
            add(rate_equations(n, order), shape.differences(leg, order))
        if shape.lines:
            add(torque_speed_equations(n, shape.lines), shape.at_points(leg))
    for leg in shape.legs[1:]:
        for order in range(1, shape.smooth + 1):
            before, after = shape.differences(leg - 1, order)[:, -1:], shape.differences(leg, order)[:, :1]
            add(meeting_equations(n, order), np.vstack([before, after]))
    if shape.rated:  # within each leg, between legs, and at both ends
        for leg in shape.legs:
            add(torque_rate_equations(n, 1), shape.torque_steps(leg))
        for leg in shape.legs[1:]:
            add(torque_rate_equations(n, 2), shape.torque_meeting(leg))
        for leg, end in ((0, 0), (shape.legs[-1], -1)):
            unknowns = np.append(shape.torques(leg)[end], shape.duration(leg))
            add(torque_rate_equations(n, 1, given=True), unknowns[:, None])
    everywhere = np.hstack([shape.in_intervals(leg) for leg in shape.legs])
    for each in rows:
        index = everywhere[:, each.intervals(shape.intervals)]
        add(each.functions(CurveInterval(dynamics, compile_mode)), index, True, each)
    return program_of(blocks, shape.size, [shape.duration(leg) for leg in shape.legs], shared - 1)
