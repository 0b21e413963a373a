"""Initial curves of a live motion: the rest of the last motion, deformed to the new goal, and a direct one."""

import numpy as np

from armdyn.arrays import Array
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.live.mesh import Places
from armdyn.optimal.live.program import Ends

_SHORTEST = 1e-3
"""Least duration of a guess [s]."""
_WITHIN = 0.7
"""Part of the torques that a guess uses for its accelerations, by the inertia at its start."""


def direct(mesh: Places, ends: Ends, limits: JointLimits, inertia: Array) -> tuple[Array, float]:
    """Cubic polynomials from the start state to rest, in the time of the slowest joint alone.

    Each joint is a double integrator: full acceleration, velocity limit, full deceleration.

    Args:
        mesh: mesh of the curve.
        ends: start state and goal.
        limits: limits of velocities and torques.
        inertia: inertia of each joint at the start [kg m² or kg], shape (nv,).

    Returns:
        Control points and duration.
    """
    way, a = ends.goal - ends.q, _WITHIN * limits.actuators.half_range / inertia
    turn = np.where(way < ends.v * np.abs(ends.v) / (2 * a), -1.0, 1.0)
    way, v, fastest = turn * way, turn * ends.v, limits.velocity
    peak = np.sqrt(np.maximum(a * way + v**2 / 2, 0))
    top = np.minimum(peak, fastest)
    cruise = np.maximum(way - (2 * top**2 - v**2) / (2 * a), 0) / fastest
    duration = float(max(np.max((2 * top - v) / a + cruise), _SHORTEST))
    r = mesh.basis.places[:, None]
    lead, blend = (r**3 - 2 * r**2 + r) * ends.v * duration, _blend(r)
    return ends.q + lead + blend * (ends.goal - ends.q), duration


def rest_of(mesh: Places, positions: Array, ends: Ends, duration: float) -> tuple[Array, float]:
    """The rest of a motion, bent to another goal.

    Args:
        mesh: mesh of the curve.
        positions: positions of the motion at the parts `mesh.basis.places` of the remaining time [rad or m], shape
            (basis.size, nv).
        ends: start state and goal.
        duration: remaining time [s].

    Returns:
        Control points and duration.
    """
    r = mesh.basis.places[:, None]
    correction = (1 - _blend(r)) * (ends.q - positions[0]) + _blend(r) * (ends.goal - positions[-1])
    return positions + correction, max(duration, _SHORTEST)


def _blend(r: Array) -> Array:
    """Smooth step from 0 to 1, with zero slope at both ends."""
    return 3 * r**2 - 2 * r**3
