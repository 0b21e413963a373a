"""Torques that are constant piece by piece, as a mesh's are."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Pieces:
    """Torques that are constant piece by piece.

    Attributes:
        t: the pieces' ends [s], shape (P + 1,).
        tau: [N m or N], shape (P, nv).
    """

    t: Array
    tau: Array

    @classmethod
    def of(cls, motion: Trajectory) -> Self | None:
        """The pieces of a motion; None if its torques are not constant between jumps."""
        t, tau, passes = motion.t, motion.tau, ~motion.jumps
        if not np.array_equal(tau[1:][passes], tau[:-1][passes]):
            return None
        first = np.append(True, np.any(tau[1:] != tau[:-1], axis=1))[:-1] & passes
        first[0] = True
        starts = np.flatnonzero(first)
        return cls(np.append(t[starts], t[-1]), tau[starts])

    def trajectory(self, like: Trajectory, samples: int) -> Trajectory:
        """The pieces as samples, with the states of the motion near them.

        Args:
            like: that motion; its times are scaled.
            samples: of every piece, besides its end.
        """
        times, torques = [], []
        for k, tau in enumerate(self.tau):
            last = k == len(self.tau) - 1
            within = np.linspace(self.t[k], self.t[k + 1], samples + 1)
            times += [*within[:-1], within[-1] if last else np.nextafter(within[-1], 0)]
            torques += [tau] * (samples + 1)
        part = np.array(times) / self.t[-1]
        at = like(like.t[0] + part * like.duration)
        return replace(like, t=np.array(times), q=at.q, v=at.v, tau=np.array(torques))
