"""Costates of a motion and their integrals, from which derivatives of its cost follow, whatever method found it."""

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.arcs.arc import Mode
from armdyn.optimal.arcs.phases import Phases
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.reprs import brief


@brief
@dataclass(frozen=True, eq=False)
class Costates:
    """Costates of an optimum, and their integrals over parts of its time with one point of the motion in each.

    Attributes:
        t: knots [s], shape (K + 1,).
        costate: ρ = ∂(cost to go)/∂(q, v) at the knots, shape (K + 1, 2 nv).
        q: positions at the points, shape (P, nv).
        v: velocities at the points, shape (P, nv).
        tau: torques at the points, shape (P, nv).
        pushed: ∫ρ_v dt over each point's part, the derivatives by the accelerations there [s²/rad], shape (P, nv).
        switched: ∫S dt, the derivatives by the torques there [s/(N m)], shape (P, nv): negative on the upper limit,
            positive on the lower one; 0 of a joint without a motor.
        velocity: ∂cost/∂(velocity limit) [s²/rad], shape (nv,); not positive.
    """

    t: Array
    costate: Array
    q: Array
    v: Array
    tau: Array
    pushed: Array
    switched: Array
    velocity: Array

    @property
    def effort_upper(self) -> Array:
        """∂cost/∂(upper torque limit) [s/(N m)], shape (nv,); not positive."""
        return np.asarray(np.minimum(self.switched, 0.0).sum(axis=0))

    @property
    def effort_lower(self) -> Array:
        """∂cost/∂(lower torque limit) [s/(N m)], shape (nv,); not negative."""
        return np.asarray(np.maximum(self.switched, 0.0).sum(axis=0))


def costates_of(problem: MinimumTimeProblem, phases: Phases) -> Costates:
    """Costates of arcs: the points are the stages of their intervals."""
    modes, n = phases.modes, phases.q.shape[1]
    speed = phases.state_multiplier[:, :, 1].sum(axis=1)
    speed[:-1] += phases.knot_multiplier[:, 1]
    forward = 1.0 * (modes == Mode.VELOCITY_UPPER) - (modes == Mode.VELOCITY_LOWER)
    return Costates(
        t=phases.t,
        costate=phases.costate,
        q=phases.stage_q.reshape(-1, n),
        v=phases.stage_v.reshape(-1, n),
        tau=phases.tau.reshape(-1, n),
        pushed=phases.stage_costate[:, :, n:].reshape(-1, n),
        switched=np.where(problem.limits.passive, 0.0, phases.torque_multiplier).reshape(-1, n),
        velocity=np.sum(speed * forward, axis=0),
    )
