"""Replay of torques through Pinocchio's `aba`, friction included, with an integrator independent of collocation."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from armdyn.arguments import expect, number, stopper
from armdyn.dynamics.motion import replayed
from armdyn.errors import TrajectoryError
from armdyn.models.robots.loads import robots_of
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

RTOL = 1e-11
"""Relative tolerance of the integrator: far below the goal errors to be detected. With 1e-10 a step through a wrist
that its damping stops in 70 µs is off by up to 1.7e-7 rad/s, which the error estimate does not see (xArm7)."""
_SPARE = 300_000
"""Largest number of accelerations in halved steps: half a second; motions of well-posed dynamics need none."""
_SPARE_WHEN_LATE = 30_000
"""Largest number once the solve has been stopped."""


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
    x = replayed(robot, trajectory, rtol, _SPARE_WHEN_LATE if stopper(stop)() else _SPARE)
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


def replay_of(task: Task, trajectory: Trajectory) -> Trajectory:
    """`replay_torques` with a task's robot, within its time limit."""
    return replay_torques(task.problem.robot, trajectory, stop=task.stop.__bool__)


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
        raise TrajectoryError(f"the trajectory has {own.pop()} joints; {robot.name} has {robot.nv}: {names}")
