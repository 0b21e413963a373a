"""Via points: poses that are passed through in their order, at any time and any velocity.

The mesh is dealt out to the legs between them, whose knots are bounds that coincide (`legs`), so that they need no
rows; what the replay misses them by is aimed off.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.path_constraints.constraint import ConstraintReport, PathConstraint
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ViaPoints(PathConstraint):
    """The motion passes through `problem.via`."""

    name = "via points"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return cls() if problem.via else None

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """How far beside each it passes when it should be there."""
        beside = np.abs(motion(passing).q - np.array(problem.via))
        errors = np.max(beside, axis=1)
        missed = [(i, error) for i, error in enumerate(errors) if error > self.policy.near]
        reasons = tuple(f"it passes {error:.2g} rad beside via point {i}" for i, error in missed)
        times = ", ".join(f"{t:.4f}" for t in passing)
        far, joint = np.unravel_index(np.argmax(beside), beside.shape)
        worst = Violation(
            f"via point {far}", problem.robot.joint_names[joint], float(passing[far]), float(np.max(errors))
        )
        said = f"at {times} s, within {np.max(errors):.1e} rad"
        return ConstraintReport(self.name, said, None, reasons, worst if reasons else None, errors)
