"""Derivatives of the minimum time by payload mass and limits, from the multipliers."""

from dataclasses import dataclass

import casadi as ca
import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.dynamics.symbolic import Dynamics
from armdyn.optimal.arcs.arc import VELOCITY, Mode
from armdyn.optimal.arcs.phases import Phases
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.reprs import brief


@brief
@dataclass(frozen=True, eq=False)
class Sensitivities:
    """Derivatives of t_f (with an effort weight: of the cost) at a certified optimum.

    Attributes:
        payload_mass: ∂t_f/∂m of a point mass at the tip [s/kg].
        effort_upper: ∂t_f/∂(upper torque limit) [s/(N m)], shape (nv,); not positive.
        effort_lower: ∂t_f/∂(lower torque limit) [s/(N m)], shape (nv,); not negative.
        velocity: ∂t_f/∂(velocity limit) [s²/rad], shape (nv,); not positive.
    """

    payload_mass: float
    effort_upper: Array
    effort_lower: Array
    velocity: Array

    def effort(self) -> Array:
        """∂t_f/∂(symmetric torque limit) [s/(N m)], shape (nv,)."""
        return self.effort_upper - self.effort_lower


def sensitivities(problem: MinimumTimeProblem, phases: Phases) -> Sensitivities:
    """Sensitivities of an optimum whose arcs are known.

    By the envelope theorem they are the partial derivatives of the Lagrangian: only what is held on a
    limit, and the rates through the costates, enter.

    Args:
        problem: the minimum-time problem.
        phases: its optimum.
    """
    upper, lower, velocity = by_limits(phases)
    return Sensitivities(_by_payload_mass(problem, phases), upper, lower, velocity)


def by_limits(phases: Phases) -> tuple[Array, Array, Array]:
    """Derivatives of t_f by the upper and lower torque limits and the velocity limits, as of `Sensitivities`."""
    n, arcs = phases.q.shape[1], phases.arcs
    upper, lower, velocity = np.zeros(n), np.zeros(n), np.zeros(n)
    for k, a in enumerate(phases.arc_of):
        for i, mode in enumerate(arcs[a].modes):
            if mode is Mode.UPPER:
                upper[i] += phases.torque_multiplier[k, :, i].sum()
            if mode is Mode.LOWER:
                lower[i] += phases.torque_multiplier[k, :, i].sum()
            if mode in VELOCITY:
                outward = 1.0 if mode is Mode.VELOCITY_UPPER else -1.0
                multiplier = phases.state_multiplier[k, :, 1, i].sum()
                multiplier += phases.knot_multiplier[k, 1, i] if k < len(phases.knot_multiplier) else 0.0
                velocity[i] += outward * multiplier
    return upper, lower, velocity


def _by_payload_mass(problem: MinimumTimeProblem, phases: Phases) -> float:
    robot, n = problem.robot, problem.robot.nv
    dynamics = Dynamics(robot, payload_frame=robot.tip)
    per_kg = dynamics.payload_parameters(pin.Inertia(1.0, np.zeros(3), np.zeros((3, 3))))
    q, v, tau, m = (ca.SX.sym(name, size) for name, size in (("q", n), ("v", n), ("tau", n), ("m", 1)))
    a = dynamics.aba(q, v, tau, m * ca.DM(per_kg))
    rate = ca.Function("by_mass", [q, v, tau], [ca.substitute(ca.jacobian(a, m), m, 0)])
    columns = [x.reshape(-1, n).T for x in (phases.stage_q, phases.stage_v, phases.tau)]
    da = np.array(rate.map(columns[0].shape[1])(*columns)).T
    return float(np.sum(phases.stage_costate[:, :, n:].reshape(-1, n) * da))
