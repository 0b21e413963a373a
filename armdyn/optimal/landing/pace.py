"""A motion along the same path at another pace.

Time scaled by s > 1 divides velocities by s, and all of a torque but what gravity takes by s² (Hollerbach, Dynamic
scaling of manipulator trajectories, 1984): where the arm could be held still within its torque limits they stay
within them.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from armdyn.dynamics.numeric import forward_dynamics, inverse_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.trajectory import Sample, Trajectory

Array = NDArray[np.float64]


def paced(motion: Trajectory, factor: float) -> Trajectory:
    """Positions and velocities of a motion whose time is scaled by a factor of about 1; its torques as they were.

    Args:
        motion: from t = 0.
        factor: above 0.
    """
    t = factor * motion.t
    for k in np.flatnonzero(np.diff(t) <= 0):  # the two samples of a jump are an ulp apart
        t[k] = np.nextafter(t[k + 1], 0)
    return replace(motion, t=t, v=motion.v / factor)


def paced_torques(robot: Robot, at: Sample | Trajectory, tau: Array, factor: float) -> Array:
    """The torques that the same path takes with its time scaled by a factor [N m or N], shape (m, nv).

    Args:
        robot: that moves.
        at: m positions and velocities at the old pace.
        tau: torques there, shape (m, nv).
        factor: above 0.
    """
    forward, inverse = forward_dynamics(robot), inverse_dynamics(robot)
    rows = zip(at.q, at.v, tau, strict=True)
    return np.array([inverse(q, v / factor, forward(q, v, torque) / factor**2) for q, v, torque in rows])
