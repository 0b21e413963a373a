"""Bang arcs read off a mesh's motion: the sign of every torque, and the times at which one changes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Switches:
    """Torques that are always on a limit: the first one of every joint, and when each changes to the other one.

    Attributes:
        first: 1 for the upper, -1 for the lower torque limit at the start, shape (nv,).
        times: switching times, increasing [s], shape (K - 1,).
        joint: joint of each switch, shape (K - 1,).
        duration: of the motion [s].
    """

    first: Array
    times: Array
    joint: Index
    duration: float

    @classmethod
    def ordered(cls, first: Array, times: Sequence[Array], duration: float) -> "Switches":
        """Switches from the times of each joint, of which two that met or crossed vanish, as do those beyond an end.

        Args:
            first: signs of the torques before any switch, shape (nv,).
            times: switching times of each joint, meant to increase [s].
            duration: of the motion [s].
        """
        signs, kept, joints = first.copy(), list[Array](), list[Index]()
        for i, own in enumerate(times):
            row: list[float] = []
            for time in own.tolist():
                if row and time <= row[-1]:
                    row.pop()
                else:
                    row.append(time)
            early = sum(time <= 0 for time in row)
            signs[i] *= (-1) ** early
            row = [time for time in row if 0 < time < duration]
            kept.append(np.array(row))
            joints.append(np.full(len(row), i))
        every = np.concatenate(kept)
        order = np.argsort(every, kind="stable")
        return cls(signs, every[order], np.concatenate(joints)[order], duration)

    @property
    def signs(self) -> Array:
        """Signs of the torques in the arcs between switches, shape (K, nv)."""
        turned = np.cumsum(self.joint[:, None] == np.arange(self.first.size), axis=0)
        return np.vstack([self.first, self.first * (-1.0) ** turned])

    @property
    def lengths(self) -> Array:
        """Lengths of the arcs [s], shape (K,)."""
        return np.diff(np.concatenate([[0.0], self.times, [self.duration]]))


def switches_of(motion: Trajectory, limits: ActuatorLimits) -> Switches:
    """The switches of a motion with torques held between its samples.

    Where the mean torque changes its sign from an interval to the next, the torque switches once; the two means say
    when.

    Args:
        motion: motion with torques near their limits, but for intervals with a switch.
        limits: torque limits, constant ones.
    """
    lengths = np.diff(motion.t)
    whole = np.flatnonzero(lengths > 1e-12 * motion.duration)
    begin, lengths = motion.t[whole], lengths[whole, None]
    levels = (motion(begin + lengths[:, 0] / 2).tau - limits.center) / limits.scale
    away, signs = (1 - np.abs(levels)) / 2 * lengths, np.where(levels > 0, 1.0, -1.0)  # time on the other limit
    times = begin[1:, None] - away[:-1] + away[1:]
    found = [own[turned] for own, turned in zip(times.T, np.diff(signs, axis=0).T != 0, strict=True)]
    return Switches.ordered(signs[0], found, motion.duration)
