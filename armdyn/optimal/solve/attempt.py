"""What comes of one guess on one mesh."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.problem.status import Status, Violation
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Attempt:
    """What IPOPT made of one guess on one mesh.

    Attributes:
        status: how it ended.
        message: IPOPT's word for it.
        trajectory: the motion; the last iterate if it did not converge.
        intervals: of the mesh.
        iterations: of IPOPT.
        worst_violation: None if it converged.
        passing: when the motion is at the via points [s], shape (vias,).
    """

    status: Status
    message: str
    trajectory: Trajectory
    intervals: int
    iterations: int
    worst_violation: Violation | None
    passing: Array = field(default_factory=lambda: np.empty(0))
