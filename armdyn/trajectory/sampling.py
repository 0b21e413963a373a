"""Sampling of a trajectory: distinct stamps, torques held between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import number
from armdyn.errors import TrajectoryError
from armdyn.trajectory.samples import Samples

if TYPE_CHECKING:
    from armdyn.trajectory.value import Trajectory

Array = NDArray[np.float64]

MOST_RATE = 1e5
"""Samples per second beyond which a rate is a mistake [Hz]: drives close their current loops ten times slower."""

MOST_SAMPLES = 200_000
"""Of one motion: 200 s at 1 kHz. Of seven joints they are 130 MB of JSON."""

LEAST_STAMP = 1e-8
"""Stamps are at least so far apart [s]: ten of the nanoseconds that ROS counts in."""

_LAST_STEP = 1e-3
"""Of a tick: a tick that is nearer to the end is left out. At `MOST_RATE` that is `LEAST_STAMP`."""


def samples_of(motion: Trajectory, rate: float | None) -> Samples:
    """See `Trajectory.resample`."""
    if motion.q.shape[1] != motion.v.shape[1]:
        raise TrajectoryError(
            f"q has {motion.q.shape[1]} columns, v {motion.v.shape[1]}; expected one of each per joint, to be resampled"
        )
    if motion.duration < LEAST_STAMP:
        raise TrajectoryError(f"the motion lasts {motion.duration:.3g} s; expected at least {LEAST_STAMP:g} s")
    t = _own(motion) if rate is None else _even(motion.duration, rate)
    with np.errstate(over="ignore", invalid="ignore"):  # overflows are refused by name
        state = motion(np.minimum(motion.t[0] + t, motion.t[-1]))
        q, v = (np.vstack([known[:-1], end[-1:]]) for known, end in ((state.q, motion.q), (state.v, motion.v)))
        a, tau = np.diff(v, axis=0) / np.diff(t)[:, None], mean_torques(motion, t)
    return Samples(
        t=t, q=q, v=v, a=np.vstack([a, a[-1:]]), tau=np.vstack([tau, tau[-1:]]),
        joint_names=motion.joint_names, name=motion.name, model_hash=motion.model_hash,
    )  # fmt: skip


def _even(duration: float, rate: float) -> Array:
    """Multiples of the period from the start, and the end [s], shape (n,)."""
    rate = number(rate, "rate", unit="Hz", sign="positive", error=TrajectoryError)
    if rate > MOST_RATE:
        raise TrajectoryError(f"rate is {rate:g} Hz; it must be at most {MOST_RATE:g} Hz")
    ticks = duration * rate
    _check_count(ticks + 1, f"{duration:g} s at {rate:g} Hz")
    whole = np.arange(int(np.ceil(ticks)) + 1)
    whole = whole[(whole == 0) | (whole <= ticks - _LAST_STEP)]
    return np.append(whole / rate, duration)


def _own(motion: Trajectory) -> Array:
    """The motion's own times from the start [s], shape (n,), each `LEAST_STAMP` or more after the one before."""
    own = motion.t - motion.t[0]
    kept = [0]
    for k in (np.flatnonzero(~motion.jumps) + 1).tolist():
        if own[k] - own[kept[-1]] >= LEAST_STAMP:
            kept.append(k)
    kept = [k for k in kept if k == 0 or own[-1] - own[k] >= LEAST_STAMP]  # the end itself stays
    _check_count(len(kept) + 1, "the motion's own")
    return np.append(own[kept], own[-1])


def _check_count(count: float, what: str) -> None:
    if count > MOST_SAMPLES:
        raise TrajectoryError(f"{what} samples are {count:.0f}; expected at most {MOST_SAMPLES}: give a lower rate")


def mean_torques(motion: Trajectory, t: Array) -> Array:
    """Mean torque over each step [N m or N], shape (n - 1, nv).

    Over a piece without a sample of the motion inside, the mean of a linear or held torque is its value in the middle.

    Args:
        motion: whose torques they are.
        t: edges of the steps, from the motion's start [s], shape (n,), increasing, within its duration.
    """
    own = motion.t - motion.t[0]
    edges = np.union1d(own, t)
    edges = edges[edges <= t[-1]]
    lengths, middles = np.diff(edges), (edges[1:] + edges[:-1]) / 2
    if motion.hold == "linear":
        tau = np.stack([np.interp(middles, own, column) for column in motion.tau.T], axis=1)
    else:
        tau = motion.tau[np.searchsorted(own, middles) - 1]
    first = np.searchsorted(edges, t[:-1])
    return np.asarray(np.add.reduceat(tau * lengths[:, None], first) / np.add.reduceat(lengths, first)[:, None])
