"""Distribution of a mesh over the legs between via points."""

from dataclasses import dataclass

import numpy as np

from armdyn.arrays import Array, Index
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Legs:
    """Distribution of a mesh's intervals over the legs between via points.

    Attributes:
        intervals: number of intervals of every leg.
        durations: durations of the legs in a guess [s], shape (legs,).
    """

    intervals: tuple[int, ...]
    durations: Array

    @property
    def of(self) -> Index:
        """Leg of each interval, shape (N,)."""
        return np.repeat(np.arange(len(self.intervals)), self.intervals)

    @property
    def knots(self) -> Index:
        """The last knot of every leg, shape (legs,)."""
        return np.cumsum(self.intervals)


def legs_of(problem: MinimumTimeProblem, guess: Trajectory, intervals: int) -> Legs:
    """Distribute intervals over legs by a guess's times at the via points.

    Every leg gets intervals in proportion to its time, and a few at least.
    """
    marks, first = [float(guess.t[0])], 0
    inner = problem.poses[1:-1]
    for i, pose in enumerate(inner):
        last = guess.t.size - (len(inner) - i)
        first = min(first + 1, last - 1)
        away = np.max(np.abs(guess.q[first:last] - pose), axis=1)
        first += int(np.argmin(away))
        marks.append(float(guess.t[first]))
    durations = np.maximum(np.diff([*marks, guess.t[-1]]), 1e-3 * guess.duration)
    least = max(min(4, intervals // durations.size), 1)
    spare = intervals - least * durations.size
    if spare < 0:
        raise ValueError(f"{intervals} intervals are too few for {durations.size} legs")
    edges = np.round(spare * np.append(0.0, np.cumsum(durations)) / durations.sum()).astype(int)
    return Legs(tuple((np.diff(edges) + least).tolist()), durations)
