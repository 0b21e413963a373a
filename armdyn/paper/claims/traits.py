"""Traits of motions that the paper describes, measured: turns, overshoot, ranges, growth with payload."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arrays import Array
from armdyn.trajectory import Trajectory

_VISIBLE = 1e-3
"""Swings back smaller than this [rad] count as no reversal: no figure shows them."""
_SAMPLES = 20_001


@dataclass(frozen=True)
class Traits:
    """Traits of a motion, one number per joint.

    Attributes:
        reversals: number of times that a joint turns round and goes back at least 1e-3 rad.
        swings: the longest way back after a reversal [rad].
        overshoot: farthest past the goal, seen from the start [rad].
        position: range of positions, largest minus smallest [rad].
        velocity: smallest and largest velocity [rad/s].
        torque: range of torques, largest minus smallest [N m].
        peak_torque: largest |torque| [N m].
    """

    reversals: tuple[int, ...]
    swings: tuple[float, ...]
    overshoot: tuple[float, ...]
    position: tuple[float, ...]
    velocity: tuple[tuple[float, float], ...]
    torque: tuple[float, ...]
    peak_torque: tuple[float, ...]

    @classmethod
    def of(cls, motion: Trajectory, q_goal: ArrayLike) -> "Traits":
        """Read a motion, also between its samples.

        Args:
            motion: of nv joints.
            q_goal: [rad], shape (nv,).
        """
        goal = np.asarray(q_goal, dtype=float)
        t = np.union1d(motion.t, np.linspace(motion.t[0], motion.t[-1], _SAMPLES))
        q, v, _ = motion(t)
        swings = [np.abs(np.diff(turning_points(q[:, i])))[1:] for i in range(goal.size)]
        past = np.sign(goal - q[0]) * (q - goal)
        return cls(
            reversals=tuple(back.size for back in swings),
            swings=tuple(float(back.max(initial=0.0)) for back in swings),
            overshoot=tuple(float(x) for x in np.maximum(past.max(axis=0), 0.0)),
            position=tuple(float(x) for x in np.ptp(q, axis=0)),
            velocity=tuple((float(a), float(b)) for a, b in zip(v.min(axis=0), v.max(axis=0), strict=True)),
            torque=tuple(float(x) for x in np.ptp(motion.tau, axis=0)),
            peak_torque=tuple(float(x) for x in np.abs(motion.tau).max(axis=0)),
        )


def turning_points(q: Array) -> Array:
    """Turning points: the start, extremes that a way back of at least 1e-3 rad follows, and the last extreme.

    Args:
        q: one joint's positions over time [rad], shape (n,).

    Returns:
        Positions [rad], shape (2 + number of reversals,).
    """
    turns, extreme, direction = [q[0]], q[0], 0.0
    for here in q:
        if direction * (here - extreme) > 0:
            extreme = here
        elif abs(here - extreme) >= _VISIBLE:
            if direction:
                turns.append(extreme)
            direction, extreme = float(np.sign(here - extreme)), here
    return np.array([*turns, extreme])


def largest_error(motion: Trajectory, q_goal: ArrayLike, since: float) -> float:
    """Largest distance of any joint from its goal, from a time on [rad].

    Args:
        motion: of nv joints.
        q_goal: [rad], shape (nv,).
        since: [s].
    """
    t = np.union1d(motion.t[motion.t >= since], np.linspace(since, motion.t[-1], _SAMPLES))
    return float(np.max(np.abs(motion(t).q - np.asarray(q_goal, dtype=float))))


@dataclass(frozen=True)
class PayloadEffect:
    """Change of a time with the payload.

    Attributes:
        payloads: M, increasing [kg].
        times: the time of each [s]; None: the motion does not end at the goal.
    """

    payloads: tuple[float, ...]
    times: tuple[float | None, ...]

    @classmethod
    def of(cls, times: Sequence[tuple[float, float | None]]) -> "PayloadEffect":
        """Effect of payload, from pairs of payload [kg] and time [s] in any order."""
        pairs = sorted(times, key=lambda pair: pair[0])
        return cls(tuple(m for m, _ in pairs), tuple(t for _, t in pairs))

    @property
    def reached(self) -> tuple[tuple[float, float], ...]:
        """Payloads [kg] and times [s] of the motions that end at the goal."""
        return tuple((m, t) for m, t in zip(self.payloads, self.times, strict=True) if t is not None)

    @property
    def rises(self) -> bool:
        """Whether every payload has a time, and each takes longer than the one before."""
        times = [t for _, t in self.reached]
        return len(times) == len(self.times) and bool(np.all(np.diff(times) > 0))

    @property
    def ratio(self) -> float | None:
        """Time of the heaviest over that of the lightest payload that has one; None: fewer than two have."""
        times = [t for _, t in self.reached]
        return times[-1] / times[0] if len(times) > 1 else None
