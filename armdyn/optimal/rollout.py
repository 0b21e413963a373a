"""Replays torques through `pin.aba` with an integrator that knows nothing of the collocation."""

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from armdyn.models.robot import Robot
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]

RTOL = 1e-10
"""Of the replay's integrator: far below any goal error that it is to reveal."""


def replay_torques(robot: Robot, trajectory: Trajectory, rtol: float = RTOL) -> Trajectory:
    """What the arm does when it starts like a trajectory and is given its torques, open loop.

    Dormand-Prince 8(5,3) (`scipy.integrate.DOP853`), started anew at every sample, where the torque
    has a corner or a jump.

    Args:
        robot: the arm.
        trajectory: whose first state and torques are used; its other states are not looked at.
        rtol: relative tolerance of the integrator; absolute 1e-2 of that.

    Returns:
        States at the same times, with the same torques. It ends early, but with two samples at least,
        where the states leave what numbers can hold.
    """
    model, data = robot.model, robot.model.createData()
    n = robot.nv

    def rate(t: float, x: Array, start: float, tau: Array, slope: Array) -> Array:
        a = pin.aba(model, data, robot.configuration(x[:n]), x[n:], tau + (t - start) * slope)
        return np.concatenate([x[n:], a])

    states = [np.concatenate([trajectory.q[0], trajectory.v[0]])]
    for k in range(trajectory.t.size - 1):
        t0, t1 = trajectory.t[k], trajectory.t[k + 1]
        if t1 - t0 <= 2 * np.spacing(t1):  # a jump of the torque: no time passes
            states.append(states[-1])
            continue
        slope = (trajectory.tau[k + 1] - trajectory.tau[k]) / (t1 - t0)
        run = solve_ivp(
            rate, (t0, t1), states[-1], "DOP853", rtol=rtol, atol=1e-2 * rtol, first_step=t1 - t0,
            args=(t0, trajectory.tau[k], slope),
        )  # fmt: skip
        if not run.success or not np.all(np.isfinite(run.y[:, -1])):
            break
        states.append(run.y[:, -1])
    if len(states) == 1:
        states.append(states[0])
    x = np.array(states)
    m = len(x)
    return Trajectory(
        trajectory.t[:m], x[:, :n], x[:, n:], trajectory.tau[:m], trajectory.joint_names, f"{trajectory.name} replay"
    )
