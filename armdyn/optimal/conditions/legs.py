"""How a mesh is dealt out to the legs between via points, and where to aim instead of them."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Legs:
    """How a mesh is dealt out to the legs between poses that are passed through.

    Attributes:
        intervals: of every leg.
        durations: of every leg in a guess [s], shape (legs,).
    """

    intervals: tuple[int, ...]
    durations: Array

    @property
    def of(self) -> NDArray[np.int_]:
        """Each interval's leg, shape (N,)."""
        return np.repeat(np.arange(len(self.intervals)), self.intervals)

    @property
    def knots(self) -> NDArray[np.int_]:
        """The last knot of every leg, shape (legs,)."""
        return np.cumsum(self.intervals)


def legs_of(problem: MinimumTimeProblem, guess: Trajectory, intervals: int) -> Legs:
    """Legs by when a guess passes nearest to the via points, in their order.

    Every leg gets a part of the mesh by its part of the time, and a few intervals at least.
    """
    marks, first = [float(guess.t[0])], 0
    for i, pose in enumerate(problem.via):
        last = guess.t.size - (len(problem.via) - i)
        first = min(first + 1, last - 1)
        away = np.max(np.abs(guess.q[first:last] - np.asarray(pose)), axis=1)
        first += int(np.argmin(away))
        marks.append(float(guess.t[first]))
    durations = np.maximum(np.diff([*marks, guess.t[-1]]), 1e-3 * guess.duration)
    least = max(min(4, intervals // durations.size), 1)
    spare = intervals - least * durations.size
    if spare < 0:
        raise ValueError(f"{intervals} intervals are too few for {durations.size} legs")
    edges = np.round(spare * np.append(0.0, np.cumsum(durations)) / durations.sum()).astype(int)
    return Legs(tuple((np.diff(edges) + least).tolist()), durations)


@dataclass(frozen=True, eq=False)
class Aim:
    """How far beside the via points and the goal the collocation is to aim, so that the replay is on them.

    Attributes:
        offsets: q [rad or m], shape (legs, nv), or one for all.
        end_velocity: the same for the velocity at the goal [rad/s or m/s], shape (nv,).
    """

    offsets: Array | float = 0.0
    end_velocity: Array | float = 0.0

    def corrected(self, problem: MinimumTimeProblem, replay: Trajectory, passing: Array) -> Self:
        """Aim further by what a replay misses via points and goal by; passing: when it should be there [s]."""
        at = np.vstack([replay(passing).q.reshape(-1, problem.robot.nv), replay.q[-1]])
        missed = at - problem.poses[1:]
        return type(self)(
            np.broadcast_to(self.offsets, missed.shape) - missed,
            self.end_velocity - (replay.v[-1] - np.asarray(problem.v_goal)),
        )
