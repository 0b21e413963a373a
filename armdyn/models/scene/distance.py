"""Distances for a nonlinear program: between capsules, spheres and boxes, smooth where they are positive.

The signed distance of a point from a convex body is a convex function of the point, so its least value over
a segment is found by bisection, and one Newton step after it. Bisection only looks at signs: what CasADi
differentiates is the Newton step, which has the derivatives of the exact minimiser.
"""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

_ROUNDING = 1e-4
"""Distances are rounded off within this of a body's surface or axis, to smaller ones [m]."""
_BISECTIONS = 12

Field = Callable[[ca.SX], ca.SX]
"""Of a point [m], shape (3,): its distance [m] from something convex."""


@dataclass(frozen=True)
class Solid:
    """An obstacle whose numbers are symbols: one program serves all obstacles of a kind.

    Attributes:
        distance: of a point from a sphere's centre, a capsule's axis or a box's surface [m]; negative inside a box.
        thickness: around that, still to be taken off [m].
    """

    distance: Field
    thickness: ca.SX


def from_segment(a: ca.SX, b: ca.SX) -> Field:
    """The distance of a point from a segment between two points [m]."""
    d = b - a
    length = ca.sumsqr(d)

    def field(p: ca.SX) -> ca.SX:
        t = ca.fmin(ca.fmax(ca.dot(p - a, d) / (length + 1e-12), 0), 1)
        return norm(p - a - t * d)

    return field


def least_over_segment(field: Field, a: ca.SX, b: ca.SX) -> ca.SX:
    """The least value of a field between two points [m]."""
    t, first, last = ca.SX.sym("along"), ca.SX.sym("first", 3), ca.SX.sym("last", 3)
    value = field(first + t * (last - first))
    slope = ca.gradient(value, t)
    known = {str(symbol) for symbol in (t, *ca.vertsplit(first), *ca.vertsplit(last))}
    others = [symbol for symbol in ca.symvar(value) if str(symbol) not in known]  # of the field
    at = ca.Function("slopes", [t, first, last, *others], [slope, ca.gradient(slope, t)])
    where, step = ca.SX(0.5), 0.25
    for _ in range(_BISECTIONS):
        where = where - step * ca.sign(at(where, a, b, *others)[0])
        step /= 2
    slope, curvature = at(where, a, b, *others)
    move = -slope / (curvature + 1e-9)
    where = ca.fmin(ca.fmax(where + ca.fmin(ca.fmax(move, -4 * step), 4 * step), 0), 1)
    return field(a + where * (b - a))


def from_surface(beyond: ca.SX) -> ca.SX:
    """The signed distance of a point from a body that is a product of intervals, such as a box or a cylinder [m].

    Args:
        beyond: how far the point is outside each of the intervals [m]; negative inside.
    """
    return norm(ca.fmax(beyond, 0)) + ca.fmin(ca.mmax(beyond), 0)


def norm(x: ca.SX) -> ca.SX:
    """|x| rounded off at 0, and never more than |x|."""
    return ca.sqrt(ca.sumsqr(x) + _ROUNDING**2) - _ROUNDING
