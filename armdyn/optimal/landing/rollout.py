"""Replays torques through `pin.aba`, friction included, with an integrator that knows nothing of the collocation."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.integrate import DOP853

from armdyn.arguments import expect, number, stopper
from armdyn.arrays import Array
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.errors import TrajectoryError
from armdyn.models.robots.loads import robots_of
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.optimal.landing.one_step import EVALUATIONS, at_nodes, one_step
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory

RTOL = 1e-10
"""Of the replay's integrator: far below any goal error that it is to reveal."""
_MOST_EVALUATIONS = 300_000
_MOST_WHEN_LATE = 30_000
"""When a solve is to stop: enough for a motion of well-posed dynamics, and half a second."""


def replay_torques(
    robot: Robot, trajectory: Trajectory, rtol: float = RTOL, stop: Callable[[], bool] | None = None
) -> Trajectory:
    """Motion of the arm under a trajectory's torques from its first state, open loop.

    Dormand-Prince 8(5,3) (`scipy.integrate.DOP853`), started anew wherever the torque has a corner or a jump. Each
    piece of a motion is replayed from its own first state, by the robot with its load.

    Args:
        robot: the arm.
        trajectory: whose first state and torques are used; its other states are not looked at.
        rtol: relative tolerance of the integrator; absolute 1e-2 of that.
        stop: says that there is no time for what goes astray.

    Returns:
        States at the same times, with the same torques. It ends early, but with two samples at least,
        where the states leave what numbers can hold, or after 300,000 accelerations: seconds, where a motion of
        well-posed dynamics takes some ten thousand; a tenth of that after `stop` said so.

    Raises:
        ProblemError: no Robot, rtol not positive, or stop no function.
        TrajectoryError: no Trajectory, or of another number of joints; or a piece's model is unknown, see `robots_of`.
    """
    expect_motion_of(robot, trajectory)
    number(rtol, "rtol", sign="positive")
    if trajectory.pieces:
        return _piece_by_piece(robot, trajectory, rtol, stop)
    states = _followed(robot, trajectory, rtol, stopper(stop))
    x, n = np.array(states if len(states) > 1 else 2 * states), robot.nv
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


def _followed(robot: Robot, trajectory: Trajectory, rtol: float, stop: Callable[[], bool]) -> list[Array]:
    """States at the samples, as far as `replay_torques` goes."""
    acceleration, n = forward_dynamics(robot), robot.nv

    def rate(t: float, x: Array, *, start: float, tau: Array, slope: Array) -> Array:
        return np.concatenate([x[n:], acceleration(x[:n], x[n:], tau + (t - start) * slope)])

    def enough(evaluations: int) -> bool:
        return spent + evaluations >= (_MOST_WHEN_LATE if stop() else _MOST_EVALUATIONS)

    t, torque, jumps, ends = trajectory.t, trajectory.tau, trajectory.jumps, trajectory.tau_end
    steps, change = np.diff(t), ends - torque[:-1]
    held = ~np.any(np.diff(torque, axis=0), axis=1)
    stepped = np.any(ends != torque[1:], axis=1)  # at the end of an interval
    states = [np.concatenate([trajectory.q[0], trajectory.v[0]])]
    k, spent = 0, 0
    going: Array | None = None  # the rate here, where the last step has left it and the torque does not jump
    while k < t.size - 1:
        if jumps[k]:  # no time passes
            states.append(states[-1])
            k, going = k + 1, None
            continue
        end = k + 1
        while held[k] and end < t.size - 1 and held[end]:
            end += 1  # samples of one constant torque: nothing for the integrator to stop at
        here = partial(rate, start=t[k], tau=torque[k], slope=change[k] / steps[k])
        if end == k + 1 and not enough(0):
            going = here(t[k], states[-1]) if going is None else going
            tau = at_nodes(np.stack([torque[k], ends[k]]))
            step = one_step(acceleration, tau, steps[k], states[-1], going, rtol)
            spent += EVALUATIONS
            if step is not None:
                state, going = step
                going = None if stepped[k] else going
                states.append(state)
                k = end
                continue
        going = None
        reached, evaluations = _integrate(here, t[k : end + 1], states[-1], rtol, enough)
        states, spent = states + reached, spent + evaluations
        if len(reached) < end - k:
            break
        k = end
    return states


def dense(motion: Trajectory, samples: int) -> Trajectory:
    """The torques, sampled so densely that they stay linear between samples when slowed down.

    Args:
        motion: whose torques are; its states are not looked at, and are no longer right.
        samples: of the whole, about.
    """
    steps = np.diff(motion.t)
    parts = np.where(motion.jumps, 1, np.ceil(samples * steps / motion.duration)).astype(int)
    first = np.repeat(np.arange(steps.size), parts)
    part = np.concatenate([np.arange(count) / count for count in parts])
    t = np.append(motion.t[first] + part * steps[first], motion.t[-1])
    tau = motion.tau[first] + part[:, None] * np.diff(motion.tau, axis=0)[first]
    place = np.append(first, steps.size)
    return replace(motion, t=t, q=motion.q[place], v=motion.v[place], tau=np.vstack([tau, motion.tau[-1:]]))


def under_linear_torque(robot: Robot) -> Callable[[Array, Array, Array], Array]:
    """One sample of `replay_torques`: (t, x, tau) of two samples ↦ the state at the second, shape (2 nv,).

    t are their times [s], shape (2,); x is the state (q, v) at the first, shape (2 nv,); tau their torques, shape
    (2, nv). Where the states leave what numbers can hold, they are not finite.
    """
    acceleration, n = forward_dynamics(robot), robot.nv

    def reached(t: Array, x: Array, tau: Array) -> Array:
        start = np.concatenate([x[n:], acceleration(x[:n], x[n:], tau[0])])
        step = one_step(acceleration, at_nodes(tau), t[1] - t[0], x, start, RTOL)
        if step is not None:
            return step[0]
        slope = (tau[1] - tau[0]) / (t[1] - t[0])

        def rate(at: float, state: Array) -> Array:
            return np.concatenate([state[n:], acceleration(state[:n], state[n:], tau[0] + (at - t[0]) * slope)])

        states, _ = _integrate(rate, t, x, RTOL, lambda evaluations: evaluations > _MOST_WHEN_LATE)
        return states[-1] if states else np.full_like(x, np.nan)

    return reached


def replay_of(task: Task, trajectory: Trajectory) -> Trajectory:
    """`replay_torques` by a task's robot, in its time."""
    return replay_torques(task.problem.robot, trajectory, stop=task.stop.__bool__)


def expect_motion_of(robot: Robot, trajectory: Trajectory) -> None:
    """Refuse a trajectory of other joints than a robot's.

    Raises:
        ProblemError: no Robot.
        TrajectoryError: no Trajectory, or of another number of joints.
    """
    expect_robot(robot)
    expect(trajectory, Trajectory, "trajectory", "trajectory_from_path makes one of positions", error=TrajectoryError)
    own = {trajectory.q.shape[1], trajectory.v.shape[1]} - {robot.nv}
    if own:
        names = ", ".join(robot.joint_names)
        raise TrajectoryError(f"the trajectory has {own.pop()} joints; {robot.name} has {robot.nv}: {names}")


def _integrate(
    rate: Callable[[float, Array], Array], times: Array, x: Array, rtol: float, enough: Callable[[int], bool]
) -> tuple[list[Array], int]:
    """States at times[1:], as far as they are finite and the evaluations are not enough, and how many they took.

    By the solver's own steps: `solve_ivp` takes twice as long.
    """
    solver = DOP853(rate, times[0], x, times[-1], rtol=rtol, atol=1e-2 * rtol, first_step=times[1] - times[0])
    states: list[Array] = []
    while solver.status == "running" and not enough(int(solver.nfev)):
        solver.step()
        if solver.status == "failed" or not np.all(np.isfinite(solver.y)):
            break
        passed = times[len(states) + 1 : np.searchsorted(times, solver.t, "right")]
        if passed.size:
            within = None if np.all(passed == solver.t) else solver.dense_output()
            states += [solver.y if within is None or at == solver.t else within(at) for at in passed]
    return states, int(solver.nfev)
