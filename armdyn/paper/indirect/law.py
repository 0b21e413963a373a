"""Torque laws of extremals: values from which the canonical system is built."""

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca

from armdyn.optimal.problem.problem import MinimumTimeProblem


@dataclass(frozen=True, eq=False)
class LawSymbols:
    """Arguments of a law: CasADi symbols and expressions, columns of nv unless said.

    Attributes:
        q: positions [rad or m].
        v: velocities [rad/s or m/s].
        rho_q: costates of the positions.
        rho_v: costates of the velocities.
        switching: S = ∂(ρᵀf)/∂τ = D(q)⁻¹ ρ_v.
        tau: torque [N m]; of the running cost only, as a law determines it.
        weight: w of the effort [1/(N m)²], one number.
    """

    q: ca.SX
    v: ca.SX
    rho_q: ca.SX
    rho_v: ca.SX
    switching: ca.SX
    tau: ca.SX
    weight: ca.SX


@dataclass(frozen=True)
class TorqueLaw:
    """A torque, cut off at the limits afterwards, and the Hamiltonian H = L + ρᵀf that goes with it.

    Its functions are to stand in a module, so that it can be a key of caches and go to other processes.

    Attributes:
        name: in messages.
        torque: symbols -> τ without limits [N m], shape (nv,).
        running_cost: symbols -> L, one number.
        minimises: τ is where H with L = 1 + w/2 τᵀτ is least: costates of the direct method are then its own, and
            w → 0 leads to minimum time.
        seed_weight: problem -> w of the time-energy problem whose optimum is nearest; None: the problem's own.
        remark: a remark on a solution whose H varies; "": none.
    """

    name: str
    torque: Callable[[LawSymbols], ca.SX]
    running_cost: Callable[[LawSymbols], ca.SX]
    minimises: bool
    seed_weight: Callable[[MinimumTimeProblem], float] | None = None
    remark: str = ""


def _minimiser(symbols: LawSymbols) -> ca.SX:
    return -symbols.switching / symbols.weight


def _time_and_effort(symbols: LawSymbols) -> ca.SX:
    return 1 + symbols.weight / 2 * ca.sumsqr(symbols.tau)


MINIMUM = TorqueLaw("minimum", _minimiser, _time_and_effort, minimises=True)
"""The torque that minimises H with L = 1 + w/2 τᵀτ: −S/w."""
