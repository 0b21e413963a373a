"""A motion along the same path at another pace.

Time scaled by s > 1 divides velocities by s, and torques without gravity's part by s² (Hollerbach, Dynamic scaling of
manipulator trajectories, 1984): where gravity's torque is within the limits the torques stay within them.
"""

from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import forward_dynamics, inverse_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.landing.limit_violations import excesses
from armdyn.optimal.path_constraints.tightened import ConstraintReports
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Sample, Trajectory


def can_be_slowed(problem: MinimumTimeProblem) -> bool:
    """Whether a motion of a problem may be slowed down as a whole: from rest to rest, with a motor at every joint.

    A slower motion has lower velocities at its ends; at a joint without a motor gravity's torque cannot be supplied.
    """
    return problem.from_rest_to_rest and not np.any(problem.limits.passive)


def constraints_mended(task: Task, reports: ConstraintReports) -> bool:
    """Whether the path constraints are satisfied, or would be after slowing down at little cost."""
    little = task.policy.path_constraints.slower if can_be_slowed(task.problem) else 0.0
    return reports.slowing <= 1 + little


def least_factor(robot: Robot, limits: JointLimits, motion: Trajectory, tolerance: float = 0.0) -> float:
    """Least factor on the duration with which a motion's path satisfies limits of velocity and torque at its samples.

    A torque at the pace s is g + τ_f + r/s², with gravity g, friction τ_f at the original pace, and the rest r.

    Args:
        robot: the robot.
        limits: limits to satisfy.
        motion: from rest to rest.
        tolerance: excess, as a part of a limit, that is tolerated.

    Returns:
        1 if the limits are satisfied; inf if gravity alone exceeds a limit.
    """
    torque, velocity, _ = excesses(limits, motion)
    factor = 1 + velocity.share if velocity.share > tolerance else 1.0
    if torque.share <= tolerance:
        return factor
    beyond = np.any(torque.beyond > 0, axis=1)
    q, v, tau = motion.q[beyond], motion.v[beyond], motion.tau[beyond]
    held = inverse_dynamics(robot)(q, np.zeros_like(v), np.zeros_like(v)) + robot.friction.torque(v)
    lower, upper = limits.actuators.range(q, v)
    margin = np.where(tau > upper, upper - held, held - lower)
    over = ~limits.actuators.allows(tau, q, v)
    if np.any(margin[over] <= 0):
        return np.inf
    return max(factor, float(np.sqrt(np.max(np.abs(tau - held)[over] / margin[over]))))


def paced(motion: Trajectory, factor: float) -> Trajectory:
    """Scale a motion's time by a factor of about 1; its torques stay unchanged.

    Args:
        motion: a motion from t = 0.
        factor: factor on the time, above 0.
    """
    t = factor * motion.t
    for k in np.flatnonzero(np.diff(t) <= 0):  # the two samples of a jump are an ulp apart
        t[k] = np.nextafter(t[k + 1], 0)
    return replace(motion, t=t, v=motion.v / factor)


def paced_torques(robot: Robot, at: Sample | Trajectory, tau: Array, factor: float) -> Array:
    """Torques of the same path with its time scaled by a factor [N m or N], shape (m, nv).

    Args:
        robot: the robot.
        at: m positions and velocities at the original pace.
        tau: torques there, shape (m, nv).
        factor: factor on the time, above 0.
    """
    return inverse_dynamics(robot)(at.q, at.v / factor, forward_dynamics(robot)(at.q, at.v, tau) / factor**2)
