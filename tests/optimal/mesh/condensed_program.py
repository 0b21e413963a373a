"""The condensed program as one expression, for IPOPT: the oracle of the stagewise method."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.dynamics import Dynamics
from armdyn.optimal.constraints.rows import differentiated
from armdyn.optimal.mesh.assembly import Block, Program, present_body, program_of
from armdyn.optimal.mesh.layout import Parameters


@dataclass(frozen=True, kw_only=True, eq=False)
class CondensedProgram(Program):
    """The program, and (w, p) -> states in the middle of the intervals, one column each."""

    middles: ca.Function


def condensed_program(dynamics: Dynamics, N: int) -> CondensedProgram:
    """Torques are constant in the intervals; w = [x_0 | u_0 | x_1 | u_1 | … | x_N | T]."""
    n = dynamics.nv
    y, p = ca.SX.sym("y", 5 * n + 1), ca.SX.sym("p", Parameters.size(n))
    by, body = Parameters.of(p, n), present_body(dynamics, p)
    left, u, right, duration = y[: 2 * n], y[2 * n : 3 * n], y[3 * n : 5 * n], y[-1]
    scale = ca.vertcat(ca.repmat(by.length, n, 1), ca.repmat(by.speed, n, 1))
    h = by.fraction * by.time * duration

    def rate(x):
        q, v = by.length * x[:n], by.speed * x[n:]
        return ca.vertcat(v, dynamics.aba(q, v, by.effort * u, body)) / scale

    middle = (left + right) / 2 + h / 8 * (rate(left) - rate(right))
    defects = right - left - h / 6 * (rate(left) + 4 * rate(middle) + rate(right))
    cost = by.fraction * duration * (1 + ca.dot(by.weights, u**2) / 2)
    own = 3 * n * np.arange(N)[None, :] + np.arange(5 * n)[:, None]
    places = np.vstack([own, np.full((1, N), 3 * n * N + 2 * n)])
    one = differentiated("condensed", y, p, defects, cost, False)
    block = Block(one, places, Parameters.by_interval(n, N))
    program = program_of([block], 3 * n * N + 2 * n + 1)
    w, numbers = program.functions["x"], program.functions["p"]
    each = ca.Function("middle", [y, p], [middle]).map(N)(*block.arguments(w, numbers))
    return CondensedProgram(**vars(program), middles=ca.Function("middles", [w, numbers], [each]))
