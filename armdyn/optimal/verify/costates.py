"""Costates of a motion and their integrals, from which derivatives of its cost follow, whatever method found it."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array


@dataclass(frozen=True, eq=False)
class Costates(ABC):
    """Costates of an optimum, and their integrals over parts of its time with one point of the motion in each.

    Attributes:
        t: knots [s], shape (K + 1,).
        costate: ρ = ∂(cost to go)/∂(q, v) at the knots, shape (K + 1, 2 nv).
        points: positions, velocities and torques at the points, shape (3, P, nv).
        pushed: ∫ρ_v dt over each point's part, the derivatives by the accelerations there [s²/rad], shape (P, nv).
        switched: ∫S dt, the derivatives by the torques there [s/(N m)], shape (P, nv): negative on the upper limit,
            positive on the lower one; 0 of a joint without a motor.
    """

    t: Array
    costate: Array
    points: Array
    pushed: Array
    switched: Array

    @property
    def effort_upper(self) -> Array:
        """∂cost/∂(upper torque limit) [s/(N m)], shape (nv,); not positive."""
        return np.asarray(np.minimum(self.switched, 0.0).sum(axis=0))

    @property
    def effort_lower(self) -> Array:
        """∂cost/∂(lower torque limit) [s/(N m)], shape (nv,); not negative."""
        return np.asarray(np.maximum(self.switched, 0.0).sum(axis=0))

    @property
    @abstractmethod
    def velocity(self) -> Array:
        """∂cost/∂(velocity limit) [s²/rad], shape (nv,); not positive."""
