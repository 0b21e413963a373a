"""What comes of one guess on one mesh."""

from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.problem.status import Status, Violation
from armdyn.optimal.problem.stop import Stop
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Attempt:
    """What IPOPT, or the stagewise method in its words, made of one guess on one mesh.

    Attributes:
        status: how it ended.
        message: IPOPT's word for it.
        trajectory: the motion; the last iterate if it did not converge.
        intervals: of the mesh.
        iterations: of either.
        worst_violation: None if it converged, or was not begun.
        passing: when the motion is at the via points [s], shape (vias,).
    """

    status: Status
    message: str
    trajectory: Trajectory
    intervals: int
    iterations: int
    worst_violation: Violation | None
    passing: Array = field(default_factory=lambda: np.empty(0))

    @classmethod
    def unbegun(cls, stop: Stop, guess: Trajectory, intervals: int) -> Self:
        """A guess that was not solved, because of what has stopped all."""
        return cls(stop.status, stop.word, guess, intervals, 0, None)

    @property
    def usable(self) -> bool:
        """It is a motion of the arm: it converged."""
        return self.status is Status.SOLVED
