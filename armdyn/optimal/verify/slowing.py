"""Motions within their limits: piecewise linear torques that track a motion, and its slowing down along its path.

Open loop an arm is as unstable as an inverted pendulum: the error of linear interpolation of a curve's torque would
grow. The samples are chosen for impulses equal to the curve's to fourth order, and computed torque corrects the rest,
sample by sample, by the same integration as the replay.

Time scaled by s > 1 divides velocities by s, and torques without gravity's part by s² (Hollerbach, Dynamic scaling of
manipulator trajectories, 1984): where gravity's torque is within the limits the torques stay within them.
"""

import time
from dataclasses import replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.motion import Feedback, tracked
from armdyn.dynamics.numeric import forward_dynamics, forward_dynamics_derivatives, inverse_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.constraints.constraint import ConstraintReports
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import GOAL_TOLERANCE, LIMIT_TOLERANCE, certify
from armdyn.optimal.verify.limit_violations import excesses
from armdyn.optimal.verify.optimum import Optimum, trajectory_cost
from armdyn.optimal.verify.rollout import RTOL, SPARE_WHEN_LATE, dense, replay_of
from armdyn.reprs import percent
from armdyn.trajectory import Sample, Trajectory

_CLIPS = 2
"""Rounds of clipping a torque to its range at the resulting state: each leaves 1e-3 of the excess."""
_LONGER = 1.0, 0.1
"""Time for the replay after the deadline [s], and part of the time limit: minutes of unstable motion may take more."""
FASTER = 2.0
"""Bandwidth of the feedback over the arm's fastest rate: from 1 on it holds an arm that falls. One that swings gains
energy by feedback that is half a period late, which samples so close are not."""
PER_SAMPLE = 1 / FASTER
"""Largest bandwidth times a sample's length: at 1 the sampled feedback would become unstable."""
_PLACES = 17
"""Places along a motion at which the arm's fastest rate is estimated."""


def follow(task: Task, target: Trajectory) -> Trajectory:
    """Track a motion with torques within their limits, and return the motion of the arm.

    Args:
        task: task with the robot and its torque limits.
        target: samples of the motion and its torques, which are smooth between jumps.

    Returns:
        Consistent states and torques; shorter if tracking failed, with at least two samples.
    """
    problem, numbers = task.problem, task.policy.curves
    limits, n, count = problem.limits.actuators, problem.robot.nv, target.t.size
    # With limited torque rates the curve's torques are used: the corrected lines are steeper at their corners.
    tau = target.tau if problem.continuous_torque else _lines(target)
    fade = np.ones(count - 1)
    if problem.continuous_torque:  # continuous torques end with the holding torque
        fade = np.minimum((count - 2 - np.arange(count - 1)) / numbers.samples, 1.0)
    bandwidth = max(numbers.bandwidth / target.duration, _bandwidth(problem.robot, target))
    feedback = Feedback(bandwidth, fade, 0 if limits.constant else _CLIPS)
    start = np.concatenate([problem.q_start, problem.v_start])
    until = task.stop.deadline + _LONGER[0] + _LONGER[1] * task.options.time_limit
    within = limits.clip(tau, target.q, target.v)
    x, tau = tracked(
        problem.robot, target, within, start, feedback, limits,
        late=lambda: time.perf_counter() > until, rtol=RTOL, spare=SPARE_WHEN_LATE,
    )  # fmt: skip
    if len(x) < count and time.perf_counter() > until:
        task.stop.cut()
        x = x[:2]  # it misses the goal, and checking it takes time, too
    x = x if len(x) > 1 else np.vstack([x, x])
    m = len(x)
    return replace(target, t=target.t[:m], q=x[:, :n], v=x[:, n:], tau=tau[:m])


def _bandwidth(robot: Robot, target: Trajectory) -> float:
    """Bandwidth that holds an arm that falls or swings [1/s], as far as the samples allow it."""
    return float(min(FASTER * fastest_rate(robot, target), PER_SAMPLE / np.max(np.diff(target.t))))


def fastest_rate(robot: Robot, motion: Trajectory) -> float:
    """Fastest rate of falling or swinging from rest along a motion [1/s]: the root of an eigenvalue of ∂a/∂q."""
    k = np.linspace(0, motion.t.size - 1, _PLACES).astype(int)
    still = np.zeros_like(motion.v[k])
    hold = inverse_dynamics(robot)(motion.q[k], still, still)
    by_q = forward_dynamics_derivatives(robot)(motion.q[k], still, hold)[1]
    return float(np.sqrt(np.max(np.abs(np.linalg.eigvals(by_q)))))


def _lines(motion: Trajectory) -> Array:
    """Torques at samples, linear between, with the impulses of a smooth torque: less h²/12 of its second derivative."""
    tau, flows, h = motion.tau.copy(), ~motion.jumps, np.diff(motion.t)
    inner = np.flatnonzero(flows[1:] & flows[:-1]) + 1
    before, after = h[inner - 1][:, None], h[inner][:, None]
    slopes = np.diff(motion.tau, axis=0) / h[:, None]
    second_difference = 2 * (slopes[inner] - slopes[inner - 1]) / (before + after)
    tau[inner] -= (before**3 + after**3) / (before + after) / 12 * second_difference
    return tau


def slowed(task: Task, optimum: Optimum) -> Optimum:
    """Slow an optimum down by the smallest factor for which its replay satisfies all limits and constraints.

    Every strategy ends with this step. The optimum is returned unchanged, with its arcs, if it exceeds no limit, does
    not land, cannot be slowed down (`can_be_slowed`), or violates constraints independent of pace: position limits,
    clearances, via points.

    Args:
        task: the problem and its settings.
        optimum: a replayed and certified optimum.
    """
    numbers, factor = task.policy.refinement, least_slowing(task, optimum)
    if factor == 1 or not (np.isfinite(factor) and can_be_slowed(task.problem)):
        return optimum
    if not optimum.landed:
        return optimum
    path, whole = replay_of(task, dense(optimum.trajectory, numbers.slow_samples)), 1.0
    for _ in range(numbers.slowing):
        whole *= factor
        found = _at_pace(task, optimum, path, whole)
        factor = least_slowing(task, found)
        lost = found.certificate.goal_error > max(GOAL_TOLERANCE, optimum.certificate.goal_error + numbers.path_error)
        if factor == 1 and not lost:
            return found
        if lost or not np.isfinite(factor) or task.stop:
            break
    return optimum


def least_slowing(task: Task, optimum: Optimum) -> float:
    """Factor on the duration for which the motion satisfies all limits; 1 if it does already, inf if unknown."""
    limits, motion = task.problem.limits, optimum.trajectory
    if excesses(limits, motion)[2].share > LIMIT_TOLERANCE:
        return np.inf
    return max(optimum.reports.slowing, least_factor(task.problem.robot, limits, motion, LIMIT_TOLERANCE))


def _at_pace(task: Task, optimum: Optimum, path: Trajectory, factor: float) -> Optimum:
    """Slow an optimum down along its path by a factor, and replay it."""
    problem = task.problem
    slowed = replace(paced(path, factor), tau=paced_torques(problem.robot, path, path.tau, factor))
    motion = replace(follow(task, slowed), name=optimum.trajectory.name)
    passing = factor * np.array(optimum.via_times)
    remark = optimum.certificate.remark or f"slowed down by {percent(factor - 1)} to keep its limits: no extremal"
    certificate = replace(certify(problem, motion, None, remark), idle=optimum.certificate.idle)
    return replace(
        optimum,
        trajectory=motion,
        certificate=certificate,
        cost=trajectory_cost(motion, problem.effort_weights()),
        phases=None,
        costates=None,
        arcs=(),
        reports=TightenedConstraints.of(task).check(problem, motion, passing),
        via_times=tuple(passing.tolist()),
    )


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
