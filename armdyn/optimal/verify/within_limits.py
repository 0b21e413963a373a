"""Motions and their limits: violations, linear torques that track a motion within them, the pace that keeps them.

Open loop an arm is as unstable as an inverted pendulum: the error of linear interpolation of a curve's torque would
grow. The samples are chosen for impulses equal to the curve's to fourth order, and computed torque corrects the rest,
sample by sample, by the same integration as the replay.

Time scaled by s > 1 divides velocities by s, and torques without gravity's part by s² (Hollerbach, Dynamic scaling of
manipulator trajectories, 1984): where gravity's torque is within the limits the torques stay within them.
"""

import time
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.motion import Feedback, tracked
from armdyn.dynamics.numeric import forward_dynamics, forward_dynamics_derivatives, inverse_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.constraints.constraint import ConstraintReports
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.rollout import RTOL, SPARE_WHEN_LATE
from armdyn.trajectory import Sample, Trajectory
from armdyn.trajectory.interpolation import cubic
from armdyn.trajectory.planned import Planned

BETWEEN = 8
"""Number of parts of a sample, at whose ends velocities and positions are checked."""


@dataclass(frozen=True, eq=False)
class Excess:
    """Excess of a motion over one kind of limit.

    Attributes:
        limit: name of the limit, for messages.
        t: times of the check [s], shape (m,).
        beyond: excess at these times, in the limit's unit, shape (m, nv); not positive: the limit is kept.
        units: of a joint that turns, and of one that slides.
        size: size of the limit, the scale of an excess, shape (nv,).
    """

    limit: str
    t: Array
    beyond: Array
    units: tuple[str, str]
    size: Array

    @property
    def share(self) -> float:
        """The largest excess as a part of the limit; 0 if the limit is kept."""
        return max(0.0, float(np.max(self.beyond / self.size)))

    def worst(self, robot: Robot) -> Violation:
        """Largest violation, with its joint and time."""
        k, i = np.unravel_index(np.argmax(self.beyond / self.size), self.beyond.shape)
        excess = f"{self.beyond[k, i]:.3g} {self.units[int(robot.slides[i])]}"
        share = float(self.beyond[k, i] / self.size[i])
        return Violation(self.limit, robot.joint_names[i], float(self.t[k]), share, excess)


def excesses(limits: JointLimits, motion: Trajectory, dense: int = BETWEEN) -> tuple[Excess, Excess, Excess]:
    """Excesses of a motion over its torque, velocity and position limits.

    Torque is linear between samples and is checked there. The size of a torque limit is half its range, that of a
    position limit its range, or 1 rad if the range is smaller or infinite.

    Args:
        limits: limits to check.
        motion: the motion.
        dense: number of points between samples at which velocities and positions are checked; 1: only the samples.
    """
    t, q, v = (
        np.concatenate(pair) for pair in zip((motion.t, motion.q, motion.v), _between(motion, dense), strict=True)
    )
    torque = limits.actuators.excess(motion.tau, motion.q, motion.v)
    fastest = np.where(np.isinf(limits.velocity), 1.0, limits.velocity)
    beyond = np.maximum(q - limits.position_upper, limits.position_lower - q)
    bounded = np.where(np.isinf(limits.position_upper), 0, limits.position_upper - limits.position_lower)
    return (
        Excess("torque limit", motion.t, torque, ("N m", "N"), limits.actuators.scale),
        Excess("velocity limit", t, np.abs(v) - limits.velocity, ("rad/s", "m/s"), fastest),
        Excess("position limit", t, beyond, ("rad", "m"), np.maximum(bounded, 1.0)),
    )


def proven_excess(robot: Robot, motion: Trajectory, torque: Excess) -> Excess:
    """The part of a table's excess over the torque limits that its rows prove.

    A derived torque is that of a mean acceleration over the steps around a row, in the row's state. While the torques
    are within constant limits so is their mean, but for the change of the inertias and of the other torques over these
    steps: that of the state, from the row before to the row after, is taken off.

    Args:
        robot: the arm.
        motion: the table.
        torque: its excess over the torque limits, at its samples.
    """
    if "tau" not in motion.derived or not robot.has_dynamics:
        return torque
    v = None if "v" in motion.derived else motion.v
    a, torques = Planned(motion.t, motion.q, v).accelerations(), inverse_dynamics(robot)
    rows, last = np.arange(motion.t.size), motion.t.size - 1
    before, after = np.maximum(rows - 1, 0), np.minimum(rows + 1, last)
    if v is None:  # the first and the last mean are over two steps, too
        before[-1], after[0] = last - 2, 2
    apart = [np.abs(torques(motion.q[k], motion.v[k], a) - motion.tau) for k in (before, after)]
    return replace(torque, beyond=torque.beyond - np.maximum(*apart))


def _between(motion: Trajectory, dense: int) -> tuple[Array, Array, Array]:
    """Times [s], positions and velocities between a motion's samples, shapes (m,), (m, nq), (m, nv).

    Args:
        motion: the motion.
        dense: points per interval between samples, including its first sample; a jump has no further points.
    """
    flows, parts = np.flatnonzero(~motion.jumps), np.arange(1, dense)[:, None, None] / dense
    t, h = motion.t[flows, None], np.diff(motion.t)[flows, None]
    q, v = ((x[flows], x[flows + 1]) for x in (motion.q, motion.v))
    at, speed = cubic(parts, h, q, v)
    return (t + parts * h).ravel(), at.reshape(-1, at.shape[2]), speed.reshape(-1, speed.shape[2])


def limit_violation(limits: JointLimits, motion: Trajectory, dense: int = BETWEEN) -> float:
    """Largest excess over any limit, as a part of it; 0 if all are kept. Arguments as for `excesses`."""
    return max(excess.share for excess in excesses(limits, motion, dense))


def worst_violation(robot: Robot, limits: JointLimits, motion: Trajectory, dense: int = BETWEEN) -> Violation | None:
    """The largest excess over a limit; None if all are kept. Arguments as for `excesses`."""
    worst = max(excesses(limits, motion, dense), key=lambda excess: excess.share)
    return worst.worst(robot) if worst.share > 0 else None


_CLIPS = 2
"""Rounds of clipping a torque to its range at the resulting state: each leaves 1e-3 of the excess."""
_LONGER = 1.0, 0.1
"""Time for the replay after the deadline [s], and part of the time limit: minutes of unstable motion may take more."""
FASTER = 2.0
"""Bandwidth of the feedback over the arm's fastest rate: from 1 on it holds an arm that falls. One that swings gains
energy by feedback that is half a period late, which samples so close are not."""
PER_SAMPLE = 1 / FASTER
"""Largest bandwidth times a sample's length: at 1 the sampled feedback would become unstable."""
PLACES = 2 * BETWEEN + 1
"""Places along a motion at which the arm's fastest rate is estimated, and of a straight line in a region: the ends of
twice as many parts as within a sample."""


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
    # It holds an arm that falls or swings, as far as the samples allow it.
    holding = min(FASTER * fastest_rate(problem.robot, target), PER_SAMPLE / float(np.max(np.diff(target.t))))
    bandwidth = max(numbers.bandwidth / target.duration, holding)
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


def fastest_rate(robot: Robot, motion: Trajectory) -> float:
    """Fastest rate of falling or swinging from rest along a motion [1/s]: the root of an eigenvalue of ∂a/∂q."""
    k = np.linspace(0, motion.t.size - 1, PLACES).astype(int)
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
