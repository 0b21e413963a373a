"""Commands that a controller receives of a motion: its interpolation, at the controller's ticks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armdyn.arguments import MOST_SAMPLES
from armdyn.arrays import Array
from armdyn.errors import TrajectoryError
from armdyn.trajectory import Trajectory
from armdyn.trajectory.interpolation import INTERPOLATIONS, interpolated
from armdyn.trajectory.planned import Planned

REST = 3
"""Ticks of rest before and after a motion: as many as the third difference reaches back."""


@dataclass(frozen=True, eq=False)
class Commands:
    """Commands of a motion at a controller's ticks; the arm rests before it and after it.

    Attributes:
        t: times of the ticks [s], shape (n,); the `REST` ticks before and after the motion have the times of its ends.
        q: joint positions [rad], shape (n, nv).
        v: joint velocities of the interpolation [rad/s], shape (n, nv).
        tau: joint torques [N m], shape (n, nv); None: unknown.
        ends: velocities [rad/s] and accelerations [rad/s²] at the start and the end, shape (2, 2, nv).
        interpolation: polynomials between the motion's points, a value of `INTERPOLATIONS`.
        sparse: whether points are further apart than ticks.
        rounding: smallest step of positions with a few digits after the point [rad]; 0: they have all of them.
    """

    t: Array
    q: Array
    v: Array
    tau: Array | None
    ends: Array
    interpolation: str
    sparse: bool
    rounding: float


def commands_of(motion: Trajectory | Planned, rate: float) -> Commands:
    """Commands at a rate [Hz].

    Raises:
        TrajectoryError: there are too few points or too many ticks, times do not increase, or arrays do not fit.
    """
    check_points(motion)
    start, end = float(motion.t[0]), float(motion.t[-1])
    if not (end - start) * rate <= MOST_SAMPLES:
        raise TrajectoryError(f"{end - start:.4g} s at {rate:g} Hz are more than {MOST_SAMPLES} ticks")
    ticks = start + np.arange(-REST, int(np.ceil((end - start) * rate - 1e-9)) + REST + 1) / rate
    at = np.clip(ticks, start, end)
    tau: Array | None
    if isinstance(motion, Trajectory):
        apart = np.append(True, ~motion.jumps)  # of the two sides of a jump of the torque the first
        t, given, tau = motion.t[apart], [motion.q[apart], motion.v[apart]], motion(at).tau
    else:
        t, given = motion.t, [motion.q]
        given += [] if motion.v is None else [motion.v] if motion.a is None else [motion.v, motion.a]
        tau = None if motion.tau is None else interpolated(t, [motion.tau], at)[0]
    q, v, _ = interpolated(t, given, at)
    v[(ticks < start) | (ticks > end)] = 0
    ends = _differences(t, motion.q) if len(given) == 1 else interpolated(t, given, np.array([start, end]))[1:]
    sparse = bool(np.max(np.diff(t)) > 1.5 / rate)
    return Commands(at, q, v, tau, np.stack(ends), INTERPOLATIONS[len(given)], sparse, _rounding(motion.q))


def _rounding(q: Array) -> float:
    """Largest decimal step, 1e-3 to 1e-8 rad, of which all positions are multiples; 0: there is none."""
    moving = q[:, np.ptp(q, axis=0) > 0]
    for step in (10.0**-digits for digits in range(3, 9)):
        if moving.size and np.allclose(moving / step, np.round(moving / step), rtol=0, atol=1e-4):
            return step
    return 0.0


def _differences(t: Array, q: Array) -> tuple[Array, Array]:
    """Velocities and accelerations at both ends of a motion, by differences of its positions, each of shape (2, nv)."""
    h = np.diff(t)[:, None]
    slopes = np.diff(q, axis=0) / h
    if len(slopes) == 1:
        return slopes[[0, 0]], np.zeros((2, q.shape[1]))
    a = np.diff(slopes, axis=0)[[0, -1]] / ((h[1:] + h[:-1]) / 2)[[0, -1]]
    return slopes[[0, -1]] + np.array([[-1.0], [1.0]]) * a * h[[0, -1]] / 2, a


def check_points(motion: Trajectory | Planned) -> None:
    """Check times and shapes of a motion.

    Raises:
        TrajectoryError: there are fewer than two points, times do not increase, or arrays do not fit.
    """
    t, q = np.asarray(motion.t), np.asarray(motion.q)
    if t.ndim != 1 or t.size < 2:
        raise TrajectoryError(f"a motion has two points or more; t has shape {t.shape}")
    if np.any(late := np.diff(t) <= 0):
        k = int(np.argmax(late))
        raise TrajectoryError(f"times must increase: t[{k + 1}] is {t[k + 1]:.9g} s after t[{k}] of {t[k]:.9g} s")
    for name in ("q", "v", "tau") if isinstance(motion, Trajectory) else ("q", "v", "a", "tau"):
        array = getattr(motion, name)
        if array is not None and (np.ndim(array) != 2 or np.shape(array) != (t.size, q.shape[-1])):
            raise TrajectoryError(f"{name} has shape {np.shape(array)}; expected ({t.size}, {q.shape[-1]}) as t and q")
