"""Guesses from which a solve may start. A guess is a `Trajectory`; so is a coarse solution."""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.interpolate import BPoly

from armdyn.optimal.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

_SAMPLES = 101


def detours(problem: MinimumTimeProblem, seed: int, count: int) -> list[list[Array]]:
    """What `spline` makes guesses of: first the straight way, then ways through random poses.

    Args:
        problem: what is to be solved.
        seed: the same seed gives the same detours.
        count: how many.

    Returns:
        For each guess the poses in between [rad or m], each of shape (nv,).
    """
    random = np.random.default_rng(seed)
    # Fast motions fold far out of the straight way: two radians met the best known optima most often.
    reach = np.maximum(np.abs(np.asarray(problem.q_goal) - np.asarray(problem.q_start)), 2.0)
    middle = (np.asarray(problem.q_goal) + np.asarray(problem.q_start)) / 2
    lower, upper = problem.limits.position_lower, problem.limits.position_upper
    vias = np.clip(middle + random.normal(size=(count - 1, reach.size)) * reach, lower, upper)
    return [[], *([via] for via in vias)]


def spline(problem: MinimumTimeProblem, via: list[Array]) -> Trajectory:
    """A smooth path from start to goal through poses, timed so that the torques about fit their limits.

    Args:
        problem: its start, goal and limits.
        via: poses in between [rad or m], each of shape (nv,), at equal fractions of the time.
    """
    poses = np.array([problem.q_start, *via, problem.q_goal])
    fraction = np.linspace(0, 1, len(poses))
    slopes = np.gradient(poses, fraction, axis=0) if via else np.zeros_like(poses)
    slopes[0] = slopes[-1] = 0
    curvature = np.zeros_like(poses)
    path = BPoly.from_derivatives(fraction, np.stack([poses, slopes, curvature], axis=1))
    s = np.linspace(0, 1, _SAMPLES)
    q, dq, ddq = path(s), path.derivative()(s), path.derivative(2)(s)
    duration = _fitting_duration(problem, q, dq, ddq)
    v = dq / duration
    v[0], v[-1] = problem.v_start, problem.v_goal
    tau = np.clip(
        _torques(problem, q, dq / duration, ddq / duration**2),
        problem.limits.effort_lower,
        problem.limits.effort_upper,
    )
    return Trajectory(s * duration, q, v, tau, problem.robot.joint_names, "start")


def _torques(problem: MinimumTimeProblem, q: Array, v: Array, a: Array) -> Array:
    robot = problem.robot
    data = robot.model.createData()
    return np.array(
        [pin.rnea(robot.model, data, robot.configuration(*x[:1]), *x[1:]) for x in zip(q, v, a, strict=True)]
    )


def _fitting_duration(problem: MinimumTimeProblem, q: Array, dq: Array, ddq: Array) -> float:
    """The time [s] in which the path's inertial torques reach, and its speeds keep, their limits.

    Torque along a path scales as 1/T² but for gravity, which a dynamic motion may outrun: only the part
    that scales is asked to fit.
    """
    inertial = _torques(problem, q, dq, ddq) - _torques(problem, q, 0 * dq, 0 * ddq)
    limits = problem.limits
    bound = np.where(inertial > 0, limits.effort_upper, -limits.effort_lower)
    bound = np.maximum(bound, 1e-3 * (limits.effort_upper - limits.effort_lower))
    by_torque = np.sqrt(np.max(np.abs(inertial) / bound))
    by_speed = np.max(np.abs(dq) / limits.velocity)
    return float(max(by_torque, by_speed, problem.duration_bound(), 1e-6))
