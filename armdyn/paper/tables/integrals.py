"""∫ |τ| dt of a motion: by the trapezoidal rule, and exactly."""

import numpy as np
from scipy.interpolate import CubicSpline, PPoly

from armdyn.arrays import Array
from armdyn.trajectory import Trajectory


def torque_integral(motion: Trajectory, until: float | None = None) -> Array:
    """∫ |τ_i| dt of every joint [N m s], shape (nv,), of the torque's interpolant, piece by piece between its zeros.

    A torque with jumps is taken as linear between its samples, which of a bang-bang one is the torque itself;
    one without as the cubic spline through them.

    Args:
        motion: whose torque it is.
        until: end of the integral [s]; None: of the motion.
    """
    end = motion.t[-1] if until is None else until
    return np.array(
        [_between_zeros(_interpolant(motion, joint), motion.t[0], end) for joint in range(motion.v.shape[1])]
    )


def trapezoidal_integral(motion: Trajectory, until: float | None = None, *, step: float) -> Array:
    """∫ |τ_i| dt of every joint [N m s], shape (nv,), by the trapezoidal rule with an even step.

    Args:
        motion: whose torque it is.
        until: end of the integral [s]; None: of the motion.
        step: the longest that the even step may be [s].
    """
    end = float(motion.t[-1] if until is None else until)
    t = np.linspace(motion.t[0], end, int(np.ceil((end - motion.t[0]) / step)) + 1)
    return np.asarray(np.trapezoid(np.abs(motion(t).tau), t, axis=0))


def _interpolant(motion: Trajectory, joint: int) -> PPoly:
    t, tau = motion.t, motion.tau[:, joint]
    if motion.jumps.any():
        return PPoly(np.stack([np.diff(tau) / np.diff(t), tau[:-1]]), t)
    return CubicSpline(t, tau)


def _between_zeros(torque: PPoly, start: float, end: float) -> float:
    zeros = torque.roots(discontinuity=True, extrapolate=False)
    zeros = zeros[np.isfinite(zeros) & (zeros > start) & (zeros < end)]
    edges = np.unique([start, *zeros, end])
    primitive = torque.antiderivative()(edges)
    return float(np.sum(np.abs(np.diff(primitive))))
