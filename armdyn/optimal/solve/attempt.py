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
        status: how it ended.
        message: IPOPT's word for it.
        trajectory: the motion; the last iterate if it did not converge.
        intervals: of the mesh.
        iterations: of either.
        worst_violation: None if it converged, or was not begun.
        passing: when the motion is at the via points [s], shape (vias,).
        knots: of the mesh as parts of the duration, shape (intervals + 1,); None: its intervals are equal.
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
        """A guess that was not solved, because the solve was stopped before."""
        return cls(stop.status, stop.word, guess, intervals, 0, None)

    @property
    def mesh(self) -> Array:
        """The knots as parts of the duration, shape (intervals + 1,)."""
        return mesh(self.intervals) if self.knots is None else self.knots

    @cached_property
    def quarters(self) -> Array:
        """Positions after a quarter, a half and three quarters of the duration [rad or m], shape (3, nv)."""
        t = self.trajectory.t
        return self.trajectory(t[0] + np.array([0.25, 0.5, 0.75]) * (t[-1] - t[0])).q

    @property
    def usable(self) -> bool:
        """Whether the attempt converged, and so is a motion of the arm."""
        return self.status is Status.SOLVED
