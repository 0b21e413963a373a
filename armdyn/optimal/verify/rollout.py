"""Replay of torques through Pinocchio: whole, and in segments from the knots of a mesh.

The whole replay takes an explicit Runge-Kutta pair, friction included, independent of collocation. Segments are
independent of each other, and take Gauss collocation of order six: only Pinocchio's forward dynamics is shared.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arguments import expect, number, stopper
from armdyn.arrays import Array
from armdyn.dynamics.motion import GAUSS_3, Collocation, replayed
from armdyn.dynamics.numeric import joint_inertia
from armdyn.errors import TrajectoryError
from armdyn.models.robots.loads import robots_of
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.problem.checks import LEAST_WAY
from armdyn.optimal.problem.task import Task
from armdyn.reprs import joints_of
from armdyn.trajectory import Trajectory

RTOL = 1e-11
"""Relative tolerance of the integrator: far below the goal errors to be detected. With 1e-10 a step through a wrist
that its damping stops in 70 µs is off by up to 1.7e-7 rad/s, which the error estimate does not see (xArm7)."""
_SPARE = 300_000
"""Largest number of accelerations in halved steps: half a second; motions of well-posed dynamics need none."""
SPARE_WHEN_LATE = _SPARE // 10
"""Largest number once the solve has been stopped, and between two samples under feedback."""


ACCURACY = RTOL
"""Error [rad or m, and per second] of states by integrators of this relative tolerance, restarted at every sample: ten
times the observed difference of scipy's DOP853 and Radau on segments of the library's arms."""
FEEDBACK_BANDWIDTH = 40.0
"""Bandwidth of the feedback [rad/s], 6 Hz: the position loops of industrial arms have 5 to 15 Hz; the library's arms
diverge open loop at 5 to 12 1/s."""
FEEDBACK_TICK = 0.6 / FEEDBACK_BANDWIDTH
"""Longest time for which a correction is held [s]: 15 ms. At 1 over the bandwidth the sampled loop would become
unstable, and arms' controllers run at 100 Hz and more."""

_NEAR = 10 * LEAST_WAY
"""Largest distance of a state from the motion [rad or m, and per second] under feedback: the first order in the defects
is then exact to its square, 1e-10, times the dynamics' second derivatives."""


def replay_torques(
    robot: Robot, trajectory: Trajectory, rtol: float = RTOL, stop: Callable[[], bool] | None = None
) -> Trajectory:
    """Integrate the arm's motion under a trajectory's torques from its first state, open loop.

    Dormand-Prince 8(5,3) from sample to sample, in halves where a step's error exceeds the tolerance. Each piece of a
    motion is replayed from its own first state, by the robot with its load.

    Args:
        robot: the arm.
        trajectory: trajectory with the first state and the torques; its other states are not used.
        rtol: relative tolerance of the integrator; absolute 1e-2 of that.
        stop: whether the time is up, so that diverging motions are cut short.

    Returns:
        States at the same times, with the same torques. It ends early, but with at least two samples, where the states
        overflow, or after 300,000 accelerations in halved steps; after a tenth of these if `stop` is true.

    Raises:
        ProblemError: robot is no Robot, rtol is not positive, or stop is no function.
        TrajectoryError: no Trajectory, or with a different number of joints; or a piece's model is unknown, see
            `robots_of`.
    """
    expect_motion_of(robot, trajectory)
    number(rtol, "rtol", sign="positive")
    if trajectory.pieces:
        return _piece_by_piece(robot, trajectory, rtol, stop)
    x = replayed(robot, trajectory, rtol, SPARE_WHEN_LATE if stopper(stop)() else _SPARE)
    x, n = x if len(x) > 1 else np.vstack([x, x]), robot.nv
    m = len(x)
    return Trajectory(
        trajectory.t[:m], x[:, :n], x[:, n:], trajectory.tau[:m], trajectory.joint_names, f"{trajectory.name} replay",
        robot.model_hash, trajectory.hold,
    )  # fmt: skip


def _piece_by_piece(robot: Robot, trajectory: Trajectory, rtol: float, stop: Callable[[], bool] | None) -> Trajectory:
    q, v = np.empty((0, robot.nv)), np.empty((0, robot.nv))
    for arm, part in zip(robots_of(robot, trajectory), trajectory.split(), strict=True):
        made = replay_torques(arm, replace(part, pieces=()), rtol, stop)
        begin = int(np.searchsorted(trajectory.t, part.t[0]))
        q, v = np.vstack([q[:begin], made.q]), np.vstack([v[:begin], made.v])
        if made.t[-1] != part.t[-1]:
            break
    t = trajectory.t[: len(q)]
    pieces = tuple(one for one in trajectory.pieces if one.start < t[-1])
    name = f"{trajectory.name} replay"
    return replace(trajectory, t=t, q=q, v=v, tau=trajectory.tau[: len(q)], name=name, pieces=pieces)


def dense(motion: Trajectory, samples: int) -> Trajectory:
    """Resample torques densely enough for linear interpolation, even after slowing down.

    Args:
        motion: motion with the torques; its states are resampled only, not integrated.
        samples: approximate number of samples.
    """
    steps = np.diff(motion.t)
    parts = np.where(motion.jumps, 1, np.ceil(samples * steps / motion.duration)).astype(int)
    first = np.repeat(np.arange(steps.size), parts)
    part = np.concatenate([np.arange(count) / count for count in parts])
    t = np.append(motion.t[first] + part * steps[first], motion.t[-1])
    tau = motion.tau[first] + part[:, None] * np.diff(motion.tau, axis=0)[first]
    place = np.append(first, steps.size)
    return replace(motion, t=t, q=motion.q[place], v=motion.v[place], tau=np.vstack([tau, motion.tau[-1:]]))


def replay_of(task: Task, trajectory: Trajectory, rtol: float = RTOL) -> Trajectory:
    """`replay_torques` with a task's robot, within its time limit."""
    return replay_torques(task.problem.robot, trajectory, rtol, task.stop.__bool__)


def expect_motion_of(robot: Robot, trajectory: Trajectory) -> None:
    """Refuse a trajectory of other joints than the robot's.

    Raises:
        ProblemError: robot is no Robot.
        TrajectoryError: no Trajectory, or with a different number of joints.
    """
    expect_robot(robot)
    expect(trajectory, Trajectory, "trajectory", "trajectory_from_path makes one of positions", error=TrajectoryError)
    own = {trajectory.q.shape[1], trajectory.v.shape[1]} - {robot.nv}
    if own:
        names = ", ".join(robot.joint_names)
        raise TrajectoryError(f"the trajectory has {joints_of(own.pop())}; {robot.name} has {robot.nv}: {names}")


_AGREES = LEAST_WAY / 1000
"""Defect [rad or m, and per second], relative to 1 and the state, below which one step suffices: it includes the step's
own error, and is at most a thousandth of the goal's tolerance. Likewise of the stage velocities once Newton steps no
longer halve: rounding with light links; beyond it Newton has not converged."""
_STAGES_TOLERANCE = RTOL / 1000
"""Largest error of the stage velocities, relative to 1 and the velocity, over the last two Newton steps: rounding."""
_MOST_NEWTON = 12
"""Largest number of Newton steps, and of doublings of the steps in a segment: smooth motions take two or three; Coulomb
friction in a segment takes more."""
_MOST_PARTS = 2**_MOST_NEWTON
"""Steps of order six in a segment if fewer steps, or one step and the motion's own end, disagree: a joint with dry
friction may reverse within."""


@dataclass(frozen=True, eq=False)
class Segments:
    """A motion's segments, integrated one by one, each from the motion's own state at its first sample.

    At a jump of the torque no time passes, and the state is kept.

    Attributes:
        defect: integrated end state minus the motion's own [rad or m, and per second], shape (K, 2 nv).
        state_transition: ∂(end state)/∂(start state), shape (K, 2 nv, 2 nv).
        forced: ∂(end state)/∂(torque), constant over the segment, shape (K, 2 nv, nv).
    """

    defect: Array
    state_transition: Array
    forced: Array

    @classmethod
    def of(cls, robot: Robot, motion: Trajectory, most: int = _MOST_PARTS) -> "Segments":
        """Integrate every segment of a motion.

        Args:
            robot: the arm.
            motion: states and torques; a segment is the interval between two samples.
            most: largest number of steps in a segment; 1 suffices for the growth.
        """
        x, h, n = np.concatenate([motion.q, motion.v], axis=1), np.diff(motion.t), robot.nv
        tau, step = np.stack([motion.tau[:-1], motion.tau_end], axis=1), gauss_steps(robot)
        defect, forced = -np.diff(x, axis=0), np.zeros((h.size, 2 * n, n))
        state_transition = np.tile(np.eye(2 * n), (h.size, 1, 1))
        scale = _AGREES * (1 + np.max(np.abs(x[:-1]), axis=1))
        rough, parts = np.flatnonzero(~motion.jumps), 1
        while rough.size and parts <= most:
            end, state_transition[rough], forced[rough] = step(h[rough], x[rough], tau[rough], parts)
            found = end - x[rough + 1]
            change, defect[rough] = np.max(np.abs(found - defect[rough]), axis=1), found
            settled = change <= scale[rough] if parts > 1 else np.max(np.abs(found), axis=1) <= scale[rough]
            rough, parts = rough[~settled], 2 * parts
        return cls(defect, state_transition, forced)

    @property
    def growth(self) -> float:
        """Largest singular value of ∂(end state)/∂(start state) of the motion."""
        total = np.eye(self.defect.shape[1])
        with np.errstate(over="ignore", invalid="ignore"):  # minutes of an unstable motion overflow
            for state_transition in self.state_transition:
                total = state_transition @ total
        return float(np.linalg.norm(total, 2)) if np.all(np.isfinite(total)) else float("inf")

    @property
    def largest(self) -> float:
        """Largest defect [rad or m, and per second]; infinite if a segment could not be integrated."""
        largest = float(np.max(np.abs(self.defect)))
        return largest if np.isfinite(largest) else float("inf")

    def end(self) -> Array:
        """Open-loop end state minus the motion's own, to first order in the defects, shape (2 nv,)."""
        deviation = np.zeros(self.defect.shape[1])
        for state_transition, defect in zip(self.state_transition, self.defect, strict=True):
            deviation = state_transition @ deviation + defect
        return deviation


def scales_of(*kinds: Array) -> Array:
    """Scales of states: the sizes of each kind, at least a thousandth of the largest of its kind.

    Args:
        kinds: sizes of positions, and of velocities, each of shape (nv,).

    Returns:
        Shape (2 nv,).
    """
    return np.concatenate([np.maximum(sizes, 1e-3 * np.max(sizes)) for sizes in kinds])


def transitions(robot: Robot, h: Array, x: Array, tau: Array, size: Array) -> Array | None:
    """State transition matrices of segments: ∂(end state)/∂(start state), shape (K, 2 nv, 2 nv).

    Steps of order six, twice as many in those segments whose matrices, scaled, still change by more than 1e-8.

    Args:
        robot: the arm.
        h: lengths of the segments [s], shape (K,).
        x: start states, shape (K, 2 nv).
        tau: torques at start and end [N m or N], shape (K, 2, nv).
        size: scales of the states, shape (2 nv,).

    Returns:
        None: not converged with 4,096 steps in a segment, as where a joint with dry friction reverses all along it.
    """
    step, rough, parts, scale = gauss_steps(robot), np.arange(h.size), 1, size / size[:, None]
    found = step(h, x, tau)[1]
    while rough.size and parts < _MOST_PARTS:
        parts *= 2
        finer = step(h[rough], x[rough], tau[rough], parts)[1]
        apart = np.max(np.abs(finer - found[rough]) * scale, axis=(1, 2))
        found[rough], rough = finer, rough[~(apart <= 10 * _AGREES)]
    return None if rough.size else found


def ticked(robot: Robot, motion: Trajectory, longest: float) -> Trajectory:
    """Resample a motion with samples at most a given time apart.

    Args:
        robot: the arm.
        motion: states and torques.
        longest: largest time between samples [s].

    Returns:
        The motion; new states are integrated from the sample before, so that a segment's defect is in its last part.
    """
    finer = dense(motion, int(np.ceil(motion.duration / longest)))
    if finer.t.size == motion.t.size:
        return motion
    kept = np.searchsorted(finer.t, motion.t)
    x, step = np.concatenate([finer.q, finer.v], axis=1), gauss_steps(robot)
    for part in range(1, int(np.max(np.diff(kept)))):
        at = kept[:-1][np.diff(kept) > part] + part
        x[at] = step(
            finer.t[at] - finer.t[at - 1], x[at - 1], np.stack([finer.tau[at - 1], finer.tau_end[at - 1]], axis=1)
        )[0]
    return replace(finer, q=x[:, : robot.nv], v=x[:, robot.nv :])


def gauss_steps(robot: Robot) -> Collocation:
    """Gauss collocation of order six for a robot."""
    return Collocation(robot, GAUSS_3, _STAGES_TOLERANCE, _AGREES, _MOST_NEWTON)


def under_feedback(
    robot: Robot, limits: JointLimits, motion: Trajectory, segments: Segments
) -> tuple[Trajectory, Array] | None:
    """Replay a motion under computed torque, which is held from tick to tick.

    tau = tau_k(t) − M(q_k) (2 ω (v − v_k) + ω² (q − q_k)) within the torque limits; q_k and v_k are the motion's own
    states at its samples, and at further ticks between samples more than `FEEDBACK_TICK` apart; ω is
    `FEEDBACK_BANDWIDTH`. The states are the motion's own plus the effect of the segments' defects to first order,
    which is exact to rounding for small defects.

    Args:
        robot: the arm.
        limits: limits of the torques.
        motion: states and torques.
        segments: of the motion.

    Returns:
        The replay: states and torques, corrections included, at the ticks, each torque that at the start of its tick;
        and the largest torque that feedback adds to each joint [N m or N], shape (nv,), for the deviations and for
        further ones by `ACCURACY`. None if the replay leaves the motion, because of saturated torques or a large defect
        of a segment.
    """
    try:
        ticks = ticked(robot, motion, FEEDBACK_TICK)
    except TrajectoryError:  # the states overflow between two samples
        return None
    if ticks is not motion:
        segments = Segments.of(robot, ticks)
    n, inertia = robot.nv, joint_inertia(robot)(ticks.q[:-1])
    lower, upper = limits.actuators.range(ticks.q[:-1], ticks.v[:-1])
    lowest = np.minimum(lower - np.minimum(ticks.tau[:-1], ticks.tau[1:]), 0)
    highest = np.maximum(upper - np.maximum(ticks.tau[:-1], ticks.tau[1:]), 0)
    stiffness, damping = FEEDBACK_BANDWIDTH**2, 2 * FEEDBACK_BANDWIDTH
    gains = -np.concatenate([stiffness * inertia, damping * inertia], axis=2)
    delta, correction = np.zeros((ticks.t.size, 2 * n)), np.zeros((ticks.t.size, n))
    for k, state in enumerate(delta[:-1]):
        correction[k] = np.minimum(np.maximum(gains[k] @ state, lowest[k]), highest[k])
        delta[k + 1] = segments.state_transition[k] @ state + segments.forced[k] @ correction[k] + segments.defect[k]
        if not np.max(np.abs(delta[k + 1])) <= _NEAR:
            return None
    unseen = ACCURACY * np.sum(np.abs(gains), axis=2)
    largest = np.max(np.abs(correction[:-1]) + unseen, axis=0)
    x = np.concatenate([ticks.q, ticks.v], axis=1) + delta
    return replace(ticks, q=x[:, :n], v=x[:, n:], tau=ticks.tau + correction), largest
