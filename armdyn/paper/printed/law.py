"""The paper's law of the second approach, (19) to (21), as printed.

(19), one joint: τ = −ρ_v. (20) and (21), two and three: τ = −D⁻¹ρ_v = −S. With H = 1 + ρᵀf, which is linear in τ
and which that torque does not minimise: it is the law of H = 1 + w/2 τᵀτ + ρᵀf with w = 1, and (19), which lacks
the factor k = 1/D, that with w = k.
"""

import casadi as ca

from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal import MinimumTimeProblem
from armdyn.paper.indirect import LawSymbols, TorqueLaw


def _printed_torque(symbols: LawSymbols) -> ca.SX:
    return -symbols.rho_v if symbols.rho_v.numel() == 1 else -symbols.switching


def _time_alone(symbols: LawSymbols) -> ca.SX:
    return ca.SX(1)


def _weight_of_the_law(problem: MinimumTimeProblem) -> float:
    """The w [1/(N m)²] that the law belongs to."""
    if problem.robot.nv > 1:
        return 1.0
    return 1 / float(Dynamics(problem.robot).crba(problem.q_start)[0, 0])


PRINTED = TorqueLaw(
    name="printed",
    torque=_printed_torque,
    running_cost=_time_alone,
    minimises=False,
    seed_weight=_weight_of_the_law,
    remark="the printed torque does not minimise H = 1 + ρᵀf",
)
"""(19) to (21) with H = 1 + ρᵀf; the problem's effort weight is without effect on the motion."""
