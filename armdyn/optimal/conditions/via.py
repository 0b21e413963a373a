"""Via points: poses that are passed through in their order, at any time and any velocity.

The mesh is dealt out to the legs between them, whose knots are bounds that coincide (`legs`), so that they need no
rows; what the replay misses them by is aimed off.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.optimal.conditions.condition import Condition, Kept
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.policy.landing import ConditionsPolicy
from armdyn.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ViaPoints(Condition):
    """The motion passes through `problem.via`."""

    name = "via points"

    @classmethod
    def asked_by(cls, problem: MinimumTimeProblem) -> Self | None:
        """By its keyword."""
        return cls() if problem.via else None

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> Kept:
        """How far beside each it passes when it should be there."""
        errors = np.max(np.abs(motion(passing).q - np.array(problem.via)), axis=1)
        reasons = [
            f"it passes {error:.2g} rad beside via point {i}"
            for i, error in enumerate(errors)
            if error > ConditionsPolicy.near
        ]
        times = ", ".join(f"{t:.4f}" for t in passing)
        return Kept(self.name, f"at {times} s, within {np.max(errors):.1e} rad", None, tuple(reasons), errors)
