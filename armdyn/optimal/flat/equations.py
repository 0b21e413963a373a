"""The equations of a curve: torques at points, speeds of control points, legs that meet."""

from dataclasses import dataclass

import casadi as ca

from armdyn.dynamics.symbolic import Dynamics
from armdyn.exclusive import built_once
from armdyn.optimal.flat.basis import DEGREE
from armdyn.optimal.program.compiled import compiled
from armdyn.optimal.program.interval import IntervalFunctions, differentiated, nonzeros_of

WINDOW = DEGREE + 1
"""Control points that a point of the curve depends on."""


@built_once(maxsize=16)
def torque_equations(dynamics: Dynamics, asked: bool | None) -> IntervalFunctions:
    """Torque at a point of the curve by inverse dynamics, less its unknown, as parts of the torque's scale.

    Unknowns: the control points of its window, the leg's duration T [s], the torques.
    Parameters: values, first and second derivatives of the window's B-splines, each of shape (WINDOW,); the weight of
    the squared torques; then what is shared, torque scales and the last body.
    The chain from control points to (q, q', q'') is linear: differentiated by these first.
    """
    n = dynamics.nv
    curve, duration, torque = ca.SX.sym("curve", 3 * n), ca.SX.sym("T"), ca.SX.sym("torque", n)
    basis, weight = ca.SX.sym("basis", 3 * WINDOW), ca.SX.sym("weight")
    scale, body, unused = ca.SX.sym("scale", n), ca.SX.sym("body", 10), ca.SX.sym("paid")
    present = ca.vertcat(*(body[i] if there else 0 for i, there in enumerate(dynamics.last_body != 0)))
    q, slope, bend = (curve[i * n : (i + 1) * n] for i in range(3))
    load = dynamics.rnea(q, slope / duration, bend / duration**2, present) / scale

    points = ca.SX.sym("points", n * WINDOW)
    y, p = ca.vertcat(points, duration, torque), ca.vertcat(basis, weight, scale, body, unused)
    by_order = ca.reshape(basis, WINDOW, 3).T
    chain = ca.kron(by_order, ca.SX.eye(n))  # from the window's control points to (q, q', q'')
    here = chain @ points
    inner = ca.vertcat(curve, duration)
    lam, sigma = ca.SX.sym("lam", n), ca.SX.sym("sigma")
    by_inner = ca.jacobian(load, inner)
    bends = ca.hessian(ca.dot(lam, load), inner)[0]
    outer = ca.diagcat(chain, ca.SX.eye(1))
    place = ca.Function("place", [points, basis], [here])

    jacobian = ca.horzcat(by_inner @ outer, -ca.SX.eye(n))
    hessian = ca.triu(ca.diagcat(outer.T @ bends @ outer, sigma * weight * ca.SX.eye(n)))
    at = place(points, basis)
    defects = ca.substitute(load, curve, at) - torque
    made = (
        ca.Function("torque_jacobian", [y, p], [ca.substitute(nonzeros_of(jacobian), curve, at)]),
        ca.Function("torque_hessian", [y, p, sigma, lam], [ca.substitute(nonzeros_of(hessian), curve, at)]),
    )
    fast = compiled(made, asked)
    return IntervalFunctions(
        defects=ca.Function("torque_defects", [y, p], [defects]),
        cost=ca.Function("torque_cost", [y, p], [weight / 2 * ca.sumsqr(torque)]),
        jacobian=fast[0],
        jacobian_pattern=jacobian.sparsity(),
        hessian=fast[1],
        hessian_pattern=hessian.sparsity(),
    )


@built_once(maxsize=16)
def rate_equations(joints: int, order: int) -> IntervalFunctions:
    """Control points of a derivative of the curve by time, as parts of a scale.

    Unknowns: order + 1 control points, the leg's duration T.
    Parameters: what each of them is multiplied by, shape (order + 1,); one over the scales, shape (nv,).
    """
    points, duration = ca.SX.sym("points", joints, order + 1), ca.SX.sym("T")
    factors, over_scale = ca.SX.sym("factors", order + 1), ca.SX.sym("over", joints)
    rates = points @ factors / duration**order * over_scale
    y, p = ca.vertcat(ca.vec(points), duration), ca.vertcat(factors, over_scale)
    return differentiated(f"rate{order}", y, p, rates, ca.SX(0), False)
