"""Pontryagin's canonical system of an arm: equations (16) to (21) of the paper, corrected, for any arm.

With L = 1 + w/2 τᵀτ and H = L + ρᵀf(x, τ), x = (q, v), f = (v, ABA(q, v, τ)):

    ẋ = ∂H/∂ρ = f,    ρ̇ = −∂H/∂x at fixed τ,    τ = argmin H within the limits.

f is affine in τ, so that with the switching function S = ∂(ρᵀf)/∂τ = D(q)⁻¹ ρ_v the minimising torque is
−S/w cut off at the limits, and −sign S times the limit for w = 0 (Bryson and Ho, Applied Optimal Control, ch. 3).
Another torque, and another L, is another `TorqueLaw`.
"""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.models.robots.robot import Robot
from armdyn.paper.indirect.law import MINIMUM, LawSymbols, TorqueLaw


@dataclass(frozen=True)
class CanonicalSystem:
    """CasADi Functions of y = (q, v, ρ_q, ρ_v), shape (4 nv,); every one takes a column per sample too.

    Attributes:
        nv: number of joints.
        flow: (y, τ) -> ẏ at a given torque.
        flow_jacobian: (y, τ) -> ẏ, ∂ẏ/∂y, dense, at fixed torque.
        rate: (y, w, lower, upper) -> ẏ under the law.
        rate_jacobian: (y, w, lower, upper) -> ∂ẏ/∂y, dense; where the law is cut off, of the side it is on.
        torque: (y, w, lower, upper) -> τ of the law [N m], shape (nv,).
        switching: y -> S, shape (nv,), and ∂S/∂y, shape (nv, 4 nv).
        hamiltonian: (y, τ, w) -> H, of which no term is left out, and ∂H/∂y at fixed τ.
        terminal: (y, w, lower, upper) -> H under the law, and its total derivative by y.
    """

    nv: int
    flow: ca.Function
    flow_jacobian: ca.Function
    rate: ca.Function
    rate_jacobian: ca.Function
    torque: ca.Function
    switching: ca.Function
    hamiltonian: ca.Function
    terminal: ca.Function


def canonical_system(robot: Robot, law: TorqueLaw = MINIMUM) -> CanonicalSystem:
    """The canonical system of an arm; the same arm and law give the same one.

    Args:
        robot: the arm.
        law: the torque, and the running cost in H.
    """
    return _build(Dynamics(robot), law)


def columns(function: ca.Function, *arguments: Array) -> list[Array]:
    """Evaluate a Function of columns on many columns, in numpy's memory: a third of the time of `ca.DM`.

    Args:
        function: whose inputs are columns, and whose outputs are dense.
        arguments: of shape (size,), the same for all, or (size, m).

    Returns:
        One array for each output, of shape (rows, columns, m).
    """
    m = max(x.shape[1] for x in arguments if x.ndim == 2)
    buffer, evaluate = function.map(m).buffer()
    given = [np.ascontiguousarray(np.broadcast_to(x.T, (m, len(x))), dtype=float) for x in arguments]
    made = [np.empty((m, *reversed(function.size_out(k)))) for k in range(function.n_out())]  # column by column
    for k, array in enumerate(given):
        buffer.set_arg(k, array.reshape(-1).data)  # type: ignore[call-arg]  # the stubs know C++'s alone
    for k, array in enumerate(made):
        buffer.set_res(k, array.reshape(-1).data)  # type: ignore[call-arg]
    evaluate()
    return [array.transpose(2, 1, 0) for array in made]


@built_once(maxsize=64)
def _build(dynamics: Dynamics, law: TorqueLaw) -> CanonicalSystem:
    n = dynamics.nv
    y, tau = ca.SX.sym("y", 4 * n), ca.SX.sym("tau", n)
    w, lower, upper = ca.SX.sym("w"), ca.SX.sym("lower", n), ca.SX.sym("upper", n)
    q, v, rho = y[:n], y[n : 2 * n], y[2 * n :]
    f = ca.vertcat(v, dynamics.aba(q, v, tau))
    flow = ca.vertcat(f, -ca.jtimes(f, y[: 2 * n], rho, True))
    # Linear in τ: its derivative at 0 lacks the terms of gravity and velocities.
    switching = ca.jtimes(ca.substitute(f, v, 0 * v), tau, rho, True)
    symbols = LawSymbols(q, v, rho[:n], rho[n:], switching, tau, w)
    hamiltonian = law.running_cost(symbols) + ca.dot(rho, f)
    best = ca.fmin(ca.fmax(law.torque(symbols), lower), upper)
    rate = ca.substitute(flow, tau, best)
    terminal = ca.substitute(hamiltonian, tau, best)
    p = [y, w, lower, upper]

    def function(name: str, inputs: list[ca.SX], outputs: list[ca.SX]) -> ca.Function:
        return ca.Function(name, inputs, [ca.densify(x) for x in outputs], {"cse": True})

    return CanonicalSystem(
        nv=n,
        flow=function("flow", [y, tau], [flow]),
        flow_jacobian=function("flow_jacobian", [y, tau], [flow, ca.jacobian(flow, y)]),
        rate=function("rate", p, [rate]),
        rate_jacobian=function("rate_jacobian", p, [ca.jacobian(rate, y)]),
        torque=function("torque", p, [best]),
        switching=function("switching", [y], [switching, ca.jacobian(switching, y)]),
        hamiltonian=function("hamiltonian", [y, tau, w], [hamiltonian, ca.gradient(hamiltonian, y).T]),
        terminal=function("terminal", p, [terminal, ca.gradient(terminal, y).T]),
    )
