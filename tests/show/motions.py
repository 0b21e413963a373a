"""Synthetic motions to draw: a quintic from pose to pose, its torque by inverse dynamics."""

import numpy as np
import pinocchio as pin

import armdyn as ad


def quintic(robot, q_start, q_goal, duration, name="", n=60):
    s = np.linspace(0.0, 1.0, n)[:, None]
    rise = np.subtract(q_goal, q_start)
    q = q_start + rise * (10 * s**3 - 15 * s**4 + 6 * s**5)
    v = rise * (30 * s**2 - 60 * s**3 + 30 * s**4) / duration
    a = rise * (60 * s - 180 * s**2 + 120 * s**3) / duration**2
    data = robot.model.createData()
    tau = [pin.rnea(robot.model, data, robot.configuration(q[k]), v[k], a[k]) for k in range(n)]
    return ad.Trajectory(t=duration * s[:, 0], q=q, v=v, tau=np.array(tau), joint_names=robot.joint_names, name=name)


HANGING = {"r": [-np.pi / 2], "rr": [-np.pi / 2, 0.0], "rrr": [-np.pi / 2, 0.0, 0.0]}
RAISED = {"r": [0.9], "rr": [0.6, 0.8], "rrr": [0.5, 0.7, 0.6]}
