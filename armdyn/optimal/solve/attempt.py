"""Result of one guess on one mesh."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.locks import cached_property
from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.program.unknowns import mesh
from armdyn.trajectory import Trajectory


@dataclass(frozen=True)
class Attempt:
    """Result of IPOPT, or of the stagewise method, from one guess on one mesh.

    Attributes:
        status: status of the solve.
        message: IPOPT's status in words.
        trajectory: the motion; the last iterate if it did not converge.
        intervals: number of intervals of the mesh.
        iterations: iterations of the solver.
        worst_violation: worst violation; None if the solve converged, or was not begun.
        passing: times of the via points [s], shape (vias,).
        knots: knots of the mesh as parts of the duration, shape (intervals + 1,); None: equal intervals.
    """

    status: Status
    message: str
    trajectory: Trajectory
    intervals: int
    iterations: int
    worst_violation: Violation | None
    passing: Array = field(default_factory=lambda: np.empty(0))
    knots: Array | None = None

    @classmethod
    def unbegun(cls, stop: Stop, guess: Trajectory, intervals: int) -> Self:
        """Result for a guess that was not solved, because of an earlier stop."""
        return cls(stop.status, stop.word, guess, intervals, 0, None)

    @property
    def mesh(self) -> Array:
        """Knots as parts of the duration, shape (intervals + 1,)."""
        return mesh(self.intervals) if self.knots is None else self.knots

    @cached_property
    def quarters(self) -> Array:
        """Positions at a quarter, a half and three quarters of the duration [rad or m], shape (3, nv)."""
        t = self.trajectory.t
        return self.trajectory(t[0] + np.array([0.25, 0.5, 0.75]) * (t[-1] - t[0])).q

    @property
    def usable(self) -> bool:
        """Whether the attempt converged, so that it is a motion of the arm."""
        return self.status is Status.SOLVED
