"""Terminal correction: offsets of via points and goal that cancel the misses of the replay."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Aim:
    """Offsets of a solve's via points and goal that cancel the misses of its replay.

    Attributes:
        offsets: offsets of q [rad or m], shape (legs, nv), or (nv,) for all legs.
        end_velocity: offset of the velocity at the goal [rad/s or m/s], shape (nv,).
    """

    offsets: Array | float = 0.0
    end_velocity: Array | float = 0.0

    def corrected(self, problem: MinimumTimeProblem, replay: Trajectory, passing: Array | None = None) -> Self:
        """Correct the offsets by a replay's misses at via points and goal.

        Args:
            problem: the original problem, with the true poses.
            replay: motion of the last solve, integrated.
            passing: times of the via points [s], shape (vias,); None: no via points.
        """
        vias = np.empty((0, problem.robot.nv)) if passing is None else replay(passing).q.reshape(-1, problem.robot.nv)
        missed = np.vstack([vias, replay.q[-1]]) - problem.poses[1:]
        return type(self)(
            np.broadcast_to(self.offsets, missed.shape) - missed,
            self.end_velocity - (replay.v[-1] - np.asarray(problem.v_goal)),
        )

    def at_goal(self, joints: int) -> Array:
        """Offset from the goal's state (q, v), shape (2 nv,)."""
        offset = np.broadcast_to(self.offsets, (1, joints)) if np.ndim(self.offsets) == 0 else np.asarray(self.offsets)
        return np.concatenate([offset[-1], np.broadcast_to(self.end_velocity, joints)])
