"""Bang arcs read off a mesh's motion: the sign of every torque, and the times at which one changes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.models.values.actuator_limits import ActuatorLimits
from armdyn.trajectory import Trajectory

Structure = tuple[tuple[float, ...], tuple[int, ...]]
"""First signs of the torques, and the joints that switch, in order."""


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
    def structure(self) -> Structure:
        """The switches without their times."""
        return tuple(self.first.tolist()), tuple(self.joint.tolist())

    @property
    def by_joint(self) -> list[Array]:
        """Switching times of each joint [s]."""
        return [self.times[self.joint == i] for i in range(self.first.size)]

    @property
    def signs(self) -> Array:
        """Signs of the torques in the arcs between switches, shape (K, nv)."""
        turned = np.cumsum(self.joint[:, None] == np.arange(self.first.size), axis=0)
        return np.vstack([self.first, self.first * (-1.0) ** turned])

    @property
    def lengths(self) -> Array:
        """Lengths of the arcs [s], shape (K,)."""
        return np.diff(np.concatenate([[0.0], self.times, [self.duration]]))


def switches_by(own: Switches, times: Array, switching: Array) -> Switches:
    """Switches with further ones where the torques have the wrong sign by the costates.

    A torque lowers H where it and its switching function S have opposite signs. Where it does not, an arc on the other
    limit is inserted: all of a stretch at an end of the motion; within a bang arc a quarter of the stretch; and where S
    touches zero at a switch, around that switch.

    Args:
        own: the switches.
        times: increasing, none of them at a switch [s], shape (m,).
        switching: S there, shape (m, nv).
    """
    first, found = own.first.copy(), list[Array]()
    for i, switches in enumerate(own.by_joint):
        signs = first[i] * (-1.0) ** np.searchsorted(switches, times)
        edges = np.diff(np.pad((signs * switching[:, i] > 0).astype(int), 1))
        added = list[list[float]]()
        begins, ends = np.flatnonzero(edges > 0).tolist(), np.flatnonzero(edges < 0).tolist()
        for k, m in zip(begins, ends, strict=True):
            begin, end = float(times[max(k - 1, 0)]), float(times[min(m, times.size - 1)])
            if k == 0:
                first[i] *= -1
                added.append([end])
            elif m == times.size:
                added.append([begin])
            else:
                inside = [one for one in switches.tolist() if begin < one < end]
                whole = end - begin
                within = [begin + 3 / 8 * whole, begin + 5 / 8 * whole]
                added.append([inside[0] - whole / 4, (inside[0] + end) / 2] if inside else within)
        found.append(np.sort(np.concatenate([switches, *added])))
    return Switches.ordered(first, found, own.duration)


def switches_of(motion: Trajectory, limits: ActuatorLimits, least: float = 0.0) -> Switches:
    """The switches of a motion with torques held between its samples.

    An interval whose torque is between its limits holds a switch, or two: its mean torque says where.

    Args:
        motion: motion with torques near their limits, but for intervals with a switch.
        limits: torque limits, constant ones.
        least: least part of an interval on the limit that neither neighbour is on, which is no rounding.
    """
    lengths = np.diff(motion.t)
    whole = np.flatnonzero(lengths > 1e-12 * motion.duration)
    begin, lengths = motion.t[whole], lengths[whole]
    levels = (motion(begin + lengths / 2).tau - limits.center) / limits.scale
    signs = np.where(levels > 0, 1.0, -1.0)
    found = [_switches(*columns, begin, lengths, least) for columns in zip(levels.T, signs.T, strict=True)]
    first = signs[0] * [turned for turned, _ in found]
    return Switches.ordered(first, [times for _, times in found], motion.duration)


def _switches(levels: Array, signs: Array, begin: Array, lengths: Array, least: float) -> tuple[float, Array]:
    """Switching times of one joint, and -1 if the torque begins on the limit opposite to the first interval's mean.

    Where the mean torque changes its sign from an interval to the next, the torque switches once. An interval away
    from such changes, of which a part is on the opposite limit while both neighbours are wholly on theirs, holds two
    switches, placed around its middle; the first and the last interval hold one.

    Args:
        levels: mean torques of the intervals, -1 and 1 on the limits, shape (K,).
        signs: their signs, shape (K,).
        begin: starts of the intervals [s], shape (K,).
        lengths: lengths of the intervals [s], shape (K,).
        least: see `switches_of`.
    """
    away = (1 - np.abs(levels)) / 2 * lengths  # time on the other limit
    last = np.flatnonzero(np.diff(signs) != 0)  # intervals before a change of sign
    times = [begin[last + 1] - away[last] + away[last + 1]]
    at_change = np.zeros(levels.size, bool)
    at_change[last] = at_change[last + 1] = True
    full = np.pad(np.abs(levels) > 1 - 2 * least, 1, constant_values=True)
    alone = (away > least * lengths) & full[:-2] & full[2:] & ~at_change
    at_start, at_end = bool(alone[0]), bool(alone[-1])
    times += [begin[:1] + away[:1]] * at_start + [begin[-1:] + lengths[-1:] - away[-1:]] * at_end
    alone[[0, -1]] = False
    middle = begin[alone] + lengths[alone] / 2
    times += [middle - away[alone] / 2, middle + away[alone] / 2]
    return -1.0 if at_start else 1.0, np.sort(np.concatenate(times))
