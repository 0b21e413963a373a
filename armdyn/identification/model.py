"""Torques of an arm and their regressor, at many samples."""

import numpy as np
import pinocchio as pin

from armdyn.arrays import Array
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.models.robots.robot import Robot


def rigid_torques(robot: Robot, q: Array, v: Array, a: Array) -> Array:
    """Torques without friction [N m or N], shape (n, nv), rotors included.

    Args:
        robot: the arm.
        q: positions [rad or m], shape (n, nv).
        v: velocities [rad/s or m/s], shape (n, nv).
        a: accelerations [rad/s² or m/s²], shape (n, nv).
    """
    return inverse_dynamics(robot)(q, v, a) - robot.friction.torque(v)


def mean_regressor(robot: Robot, q: Array, v: Array, a: Array, every: int) -> Array:
    """Means of the torque regressor over runs of samples, shape (n // every, nv, 10 nv); other arguments see above."""
    model, data = robot.model, robot.model.createData()
    means = np.zeros((len(q) // every, robot.nv, 10 * robot.nv))
    for i in range(len(means) * every):
        means[i // every] += pin.computeJointTorqueRegressor(model, data, robot.configuration(q[i]), v[i], a[i])
    return means / every


def means_of(values: Array, every: int) -> Array:
    """Means over runs of samples, shape (n // every, …)."""
    whole = len(values) // every * every
    return np.asarray(values[:whole].reshape(-1, every, *values.shape[1:]).mean(axis=1))
