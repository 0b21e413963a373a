"""Simulated logs of arms."""

import numpy as np

from armdyn.identification import Log
from armdyn.identification.equations import rigid_torques


def fourier_states(robot, seed, duration=10.0, rate=1000.0, harmonics=5):
    """Times, positions, velocities and accelerations of a random Fourier series within the limits."""
    rng, t = np.random.default_rng(seed), np.arange(0, duration, 1 / rate)
    k = 2 * np.pi / 10 * np.arange(1, harmonics + 1)
    s, c = np.sin(np.outer(t, k)), np.cos(np.outer(t, k))
    lower, upper = (np.clip(one, -np.pi, np.pi) for one in (robot.limits.position_lower, robot.limits.position_upper))
    q, v, a = (np.empty((t.size, robot.nv)) for _ in range(3))
    for j in range(robot.nv):
        A, B = rng.normal(size=(2, harmonics))
        x, dx, ddx = s @ (A / k) - c @ (B / k), c @ A + s @ B, c @ (B * k) - s @ (A * k)
        size = 0.8 * min((upper[j] - lower[j]) / np.ptp(x), min(robot.limits.velocity[j], 4) / np.abs(dx).max())
        q[:, j] = (upper[j] + lower[j]) / 2 + size * (x - (x.max() + x.min()) / 2)
        v[:, j], a[:, j] = size * dx, size * ddx
    return t, q, v, a


def simulated_log(robot, seed=0, *, noise=0.005, step=1e-4, velocities=False, **keywords):
    """A log of an arm: torque noise as a part of the limits, encoder steps [rad]."""
    t, q, v, a = fourier_states(robot, seed, **keywords)
    tau = rigid_torques(robot, q, v, a) + robot.friction.torque(v)
    tau = tau + np.random.default_rng(seed + 1).normal(size=tau.shape) * noise * robot.limits.effort_upper
    return Log(t=t, q=np.round(q / step) * step if step else q, v=v if velocities else None, tau=tau)
