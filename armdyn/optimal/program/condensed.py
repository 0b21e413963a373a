"""Condensed Hermite-Simpson program for the search, with fewer unknowns.

With forward dynamics the middle of an interval follows from its ends,

    x_m = (x_k + x_{k+1}) / 2 + h / 8 (f_k - f_{k+1}),

by the equations of `interval` (Betts, Practical Methods for Optimal Control, 2010, section 4.5: compressed against
separated). The middle is eliminated, and the final time is one unknown instead of one per knot: half as many unknowns
and equations, the same solutions, and four fifths of the time per iteration. The price: limits of positions and
velocities hold at the knots only, not in the middle, and path constraints are impossible.
"""

from dataclasses import dataclass

import casadi as ca

from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.program.assembly import Block, Program, program_of
from armdyn.optimal.program.interval import IntervalFunctions, differentiated, present_body
from armdyn.optimal.program.layout import CondensedLayout, Layout, Parameters
from armdyn.optimal.task.tableau import LOBATTO_3, Scheme


@dataclass(frozen=True, kw_only=True, eq=False)
class CondensedNlp(Program):
    """Program of a condensed layout.

    Attributes:
        layout: layout of the unknowns, equations and parameters.
        middles: (w, p) -> states in the middle of the intervals, one column each, shape (2 nv, N).
    """

    layout: CondensedLayout
    middles: ca.Function


def has_condensed(scheme: Scheme) -> bool:
    """Whether a scheme has a condensed layout."""
    return scheme.tableau is LOBATTO_3 and scheme.dynamics == "forward" and scheme.control != "stage"


def build_condensed(dynamics: Dynamics, scheme: Scheme, intervals: int) -> CondensedNlp:
    """The condensed NLP of an arm; parameters and equations as in `assembly.build_nlp`, without the middles'.

    Args:
        dynamics: dynamics with a symbolic last body.
        scheme: a scheme that `has_condensed`.
        intervals: number of intervals N.
    """
    layout, (one, middle) = CondensedLayout(Layout(dynamics.nv, scheme)), _interval(dynamics, scheme)
    block = Block(one, layout.intervals(intervals), Parameters.by_interval(dynamics.nv, intervals))
    program = program_of([block], layout.kept(intervals).size)
    x, p = program.functions["x"], program.functions["p"]
    middles = ca.Function("middles", [x, p], [middle.map(intervals)(*block.arguments(x, p))])
    return CondensedNlp(**vars(program), layout=layout, middles=middles)


@built_once(maxsize=16)
def _interval(dynamics: Dynamics, scheme: Scheme) -> tuple[IntervalFunctions, ca.Function]:
    """Functions of one interval, and its middle's state as a function of unknowns and parameters."""
    n, layout = dynamics.nv, CondensedLayout(Layout(dynamics.nv, scheme))
    y, p = ca.SX.sym("y", layout.width), ca.SX.sym("p", Parameters.size(n))
    by, body = Parameters.of(p, n), present_body(dynamics, p)
    scale = ca.vertcat(ca.repmat(by.length, n, 1), ca.repmat(by.speed, n, 1))
    left, first, right, last, duration = layout.parts(y)
    h = by.fraction * by.time * duration

    def rate(x: ca.SX, u: ca.SX) -> ca.SX:
        q, v = by.length * x[layout.full.knot.q], by.speed * x[layout.full.knot.v]
        scaled: ca.SX = ca.vertcat(v, dynamics.aba(q, v, by.effort * u, body)) / scale
        return scaled

    start, end = rate(left, first), rate(right, last)
    middle = (left + right) / 2 + h / 8 * (start - end)
    defects = right - left - h / 6 * (start + 4 * rate(middle, (first + last) / 2) + end)
    squares = sum(
        b * ca.dot(by.weights, u**2) for b, u in zip(LOBATTO_3.b, (first, (first + last) / 2, last), strict=True)
    )
    cost = by.fraction * duration * (1 + squares / 2)
    functions = differentiated("condensed", y, p, defects, cost, scheme.compile)
    return functions, ca.Function("condensed_middle", [y, p], [middle])
