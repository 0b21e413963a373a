"""The last motion that was handed out, and what is left of it."""

from dataclasses import dataclass, replace

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.live.mesh import Places
from armdyn.optimal.live.program import TorqueMargins
from armdyn.optimal.task.policy.live import LivePolicy
from armdyn.trajectory import Trajectory

_SECONDS = 0.1
"""By which velocities are compared with positions where the time of a state on a motion is looked for [s]."""
_LEAST = 1e-6
"""Rest of a motion that is none [s]."""
_NEWTON = 4
"""Steps by which that time is found from the nearest sample: the last one is below a nanosecond."""


@dataclass(frozen=True, eq=False)
class LastMotion:
    """A motion that the arm may be executing.

    Attributes:
        motion: from its start to rest.
        margins: of the torques with which it was found; None: not known.
        places: at which they hold, as parts of the duration.
        settled: whether it is the shortest that is found.
    """

    motion: Trajectory
    margins: TorqueMargins | None = None
    places: Array | None = None
    settled: bool = True

    def passed(self, q: Array, v: Array) -> float:
        """Time on the motion at which it is nearest to a state [s]; states of shape (nv,)."""
        motion = self.motion
        far = np.sum((motion.q - q) ** 2, axis=1) + _SECONDS**2 * np.sum((motion.v - v) ** 2, axis=1)
        t = float(motion.t[np.argmin(far)])
        for _ in range(_NEWTON):
            h = 1e-4 * motion.duration
            at, beside = motion(t), motion(np.array([max(t - h, motion.t[0]), min(t + h, motion.t[-1])]))
            a = (beside.v[1] - beside.v[0]) / (min(t + h, motion.t[-1]) - max(t - h, motion.t[0]))
            slope = (q - at.q) @ at.v + _SECONDS**2 * (v - at.v) @ a
            size = at.v @ at.v + _SECONDS**2 * a @ a
            t = float(np.clip(t + slope / size if size > 0 else t, motion.t[0], motion.t[-1]))
        return t

    def rest(self, q: Array, v: Array, policy: LivePolicy) -> Trajectory | None:
        """The rest of the motion from a state on, which begins at t = 0; None: the state is not on it.

        Args:
            q: positions [rad or m], shape (nv,).
            v: velocities [rad/s or m/s], shape (nv,).
            policy: says how far beside it a state may be.
        """
        t = self.passed(q, v)
        at, end = self.motion(t), float(self.motion.t[-1])
        beside = np.max(np.abs(at.q - q)) > policy.beside_position or np.max(np.abs(at.v - v)) > policy.beside_velocity
        if beside or end - t < _LEAST:
            return None
        left = self.motion.slice(t, end)
        return replace(left, t=left.t - t, name="rest of the last motion")

    def margins_from(self, passed: float, mesh: Places) -> TorqueMargins | None:
        """The margins of what is left after a time [s], at the places of a new curve."""
        if self.margins is None or self.places is None:
            return None
        whole = self.motion.duration
        part = (passed + (whole - passed) * mesh.places) / whole
        upper, lower = (
            np.column_stack([np.interp(part, self.places, column) for column in each.T])
            for each in (self.margins.upper, self.margins.lower)
        )
        return TorqueMargins(upper, lower)
