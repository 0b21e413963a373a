"""Flow of an arm under constant torques, its derivatives, and the switching functions.

A held joint keeps its velocity, by its own torque: the other joints move as if it were locked. Steps are Cooper and
Verner's method of eighth order (Some explicit Runge-Kutta methods of high order, SIAM J. Numer. Anal. 9, 1972).
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.codegen.compiled import compiled
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.optimal.program.interval import only_present

STEPS = 96
"""Number of steps in one call of `rollout`: steps of a third of a radian are accurate to 1e-9."""


def _tableau() -> tuple[Array, Array]:
    """Butcher tableau of Cooper and Verner's method: A, shape (11, 11), and b, shape (11,)."""
    s = float(np.sqrt(21.0))
    A = np.zeros((11, 11))
    A[1, 0] = 1 / 2
    A[2, :2] = [1 / 4, 1 / 4]
    A[3, :3] = [1 / 7, (-7 - 3 * s) / 98, (21 + 5 * s) / 49]
    A[4, [0, 2, 3]] = [(11 + s) / 84, (18 + 4 * s) / 63, (21 - s) / 252]
    A[5, [0, 2, 3, 4]] = [(5 + s) / 48, (9 + s) / 36, (-231 + 14 * s) / 360, (63 - 7 * s) / 80]
    A[6, [0, 2, 3, 4, 5]] = [
        (10 - s) / 42, (-432 + 92 * s) / 315, (633 - 145 * s) / 90, (-504 + 115 * s) / 70, (63 - 13 * s) / 35,
    ]  # fmt: skip
    A[7, [0, 4, 5, 6]] = [1 / 14, (14 - 3 * s) / 126, (13 - 3 * s) / 63, 1 / 9]
    A[8, [0, 4, 5, 6, 7]] = [1 / 32, (91 - 21 * s) / 576, 11 / 72, (-385 - 75 * s) / 1152, (63 + 13 * s) / 128]
    A[9, [0, 4, 5, 6, 7, 8]] = [
        1 / 14, 1 / 9, (-733 - 147 * s) / 2205, (515 + 111 * s) / 504, (-51 - 11 * s) / 56, (132 + 28 * s) / 245,
    ]  # fmt: skip
    A[10, 4:] = [
        (-42 + 7 * s) / 18, (-18 + 28 * s) / 45, (-273 - 53 * s) / 72, (301 + 53 * s) / 72, (28 - 28 * s) / 45,
        (49 - 7 * s) / 18, 0,
    ]  # fmt: skip
    b = np.zeros(11)
    b[[0, 7, 8, 9, 10]] = [1 / 20, 49 / 180, 16 / 45, 49 / 180, 1 / 20]
    return A, b


A, B = _tableau()


@dataclass(frozen=True, eq=False)
class Flow:
    """CasADi Functions that integrate an arm with their derivatives, and its switching functions; x = (q, v).

    Attributes:
        rollout: (x, own, begins, h, τ at the start, τ at the end, free_mask, held, body) -> ends of `STEPS` steps,
            shape (2 nv, STEPS); ∂end/∂start of each, shape
            (2 nv, 2 nv STEPS); ∂end/∂(torque along `free_mask`) at the start and at the end, shape
            (2 nv, 2 STEPS); and ẋ at the ends, shape (2 nv, STEPS). A step starts where the one before ended or,
            where `begins` is 1, at its own x; its torque is linear. The last eight have a column for each step. `held`
            is 1 for held joints.
        switching: (q, p, held, body), 2 STEPS columns each -> S = ∂(pᵀẋ)/∂τ, shape (nv, 2 STEPS).
    """

    rollout: ca.Function
    switching: ca.Function

    def rolled_out(self, own: Array, begins: Array, *columns: Array) -> tuple[Array, Array, Array, Array]:
        """Evaluate `rollout` for any multiple of `STEPS` steps, a row for each step.

        Args:
            own: initial states of steps, shape (steps, 2 nv).
            begins: 1 where a step uses its own initial state, shape (steps,); 1 for the first.
            columns: the other inputs of `rollout`, a row for each step.
        """
        size, previous = own.shape[1], np.zeros(own.shape[1])
        parts: list[list[Array]] = []
        for first in range(0, len(own), STEPS):
            part = slice(first, first + STEPS)
            parts.append(_called(self.rollout, previous, own[part], begins[part], *(each[part] for each in columns)))
            previous = parts[-1][0][-1]
        ends, jacobians, torque_sensitivities, rates = (np.concatenate(each) for each in zip(*parts, strict=True))
        state_transition = jacobians.reshape(-1, size, size).transpose(0, 2, 1)
        return ends, state_transition, torque_sensitivities.reshape(-1, 2, size).transpose(0, 2, 1), rates

    def switchings(self, *columns: Array) -> Array:
        """Evaluate `switching` for any multiple of 2 `STEPS` rows."""
        starts = range(0, len(columns[0]), 2 * STEPS)
        parts = [_called(self.switching, *(each[first : first + 2 * STEPS] for each in columns)) for first in starts]
        return np.concatenate([part for (part,) in parts])


def _called(function: ca.Function, *rows: Array) -> list[Array]:
    """Evaluate a CasADi Function of dense matrices on its buffers; every result is transposed."""
    buffer, evaluate = function.buffer()
    given = [np.ascontiguousarray(each, float) for each in rows]
    found = [np.empty(function.size_out(i)[::-1]) for i in range(function.n_out())]
    for i, each in enumerate(given):
        buffer.set_arg(i, each.reshape(-1).data)  # type: ignore[call-arg]  # the stubs have only C++'s signature
    for i, each in enumerate(found):
        buffer.set_res(i, each.reshape(-1).data)  # type: ignore[call-arg]
    evaluate()
    return found


@built_once(maxsize=64)
def flow_of(dynamics: Dynamics, compile_mode: bool | None) -> Flow:
    """Build or load the flow of an arm.

    Args:
        dynamics: dynamics with a symbolic last body.
        compile_mode: mode for `compiled`.
    """
    rate, switching = _functions(dynamics)
    n = dynamics.nv
    previous, own = ca.MX.sym("previous", 2 * n), ca.MX.sym("own", 2 * n)
    begins, h = ca.MX.sym("begins"), ca.MX.sym("h")
    first, last, free_mask = ca.MX.sym("first", n), ca.MX.sym("last", n), ca.MX.sym("free_mask", n)
    rest = [free_mask, ca.MX.sym("held", n), ca.MX.sym("body", dynamics.last_body.size)]
    # The state, its transition from the start, and its sensitivity to the torques at both ends.
    start = begins * own + (1 - begins) * previous, ca.densify(ca.MX.eye(2 * n)), ca.MX.zeros(2 * n, 2)
    stages: list[tuple[ca.MX, ...]] = []
    for row, c in zip(A, A.sum(axis=1), strict=True):
        now = start
        for a, slopes in zip(row, stages, strict=False):
            if a:
                now = tuple(at + (h * a) * slope for at, slope in zip(now, slopes, strict=True))
        x, state_transition, torque_sensitivity = now
        f, by_x, by_tau = rate(x, (1 - c) * first + c * last, *rest)
        by_ends = by_x @ torque_sensitivity + ca.horzcat((1 - c) * by_tau, c * by_tau)
        stages.append((f, by_x @ state_transition, by_ends))
    end, state_transition, torque_sensitivity = (
        at + h * sum(b * each for b, each in zip(B, every, strict=True) if b)
        for at, every in zip(start, zip(*stages, strict=True), strict=True)
    )
    inputs = [previous, own, begins, h, first, last, *rest]
    outputs = [end, state_transition, torque_sensitivity, rate(end, last, *rest)[0]]
    step = ca.Function("step", inputs, [ca.densify(each) for each in outputs])
    many = switching.map(2 * STEPS)
    columns = many.mx_in()
    rollout, many = compiled(
        [step.mapaccum("march", STEPS, 1), ca.Function("switchings", columns, many.call(columns))], compile_mode
    )
    return Flow(rollout, many)


def _functions(dynamics: Dynamics) -> tuple[ca.Function, ca.Function]:
    """(x, τ, free_mask, held, body) -> ẋ, ∂ẋ/∂x and ∂ẋ/∂τ along `free_mask`; and one column of `Flow.switching`."""
    n = dynamics.nv
    x, tau, held = ca.SX.sym("x", 2 * n), ca.SX.sym("tau", n), ca.SX.sym("held", n)
    numbers, p = ca.SX.sym("body", dynamics.last_body.size), ca.SX.sym("p", 2 * n)
    body, free_mask = only_present(dynamics, numbers), ca.SX.sym("free_mask", n)
    q, v, free = x[:n], x[n:], 1 - held
    inertia = ca.diag(free) @ dynamics.crba(q, body) @ ca.diag(free) + ca.diag(held)
    factors = ca.ldl(inertia, False)  # L D Lᵀ, in the joints' own order
    f = ca.vertcat(v, ca.ldl_solve(free * (tau - dynamics.nle(q, v, body)), *factors))
    jacobian = ca.densify(ca.jacobian(f, x))
    torque_sensitivity = ca.densify(ca.vertcat(ca.SX.zeros(n), free * ca.ldl_solve(free * free_mask, *factors)))
    switching = free * ca.ldl_solve(free * p[n:], *factors)
    return (
        ca.Function("rate", [x, tau, free_mask, held, numbers], [f, jacobian, torque_sensitivity], {"cse": True}),
        ca.Function("switching", [q, p, held, numbers], [ca.densify(switching)], {"cse": True}),
    )
