"""The arm keeps clear of obstacles."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from armdyn.models.scene.bodies import capsules
from armdyn.models.scene.collision import CollisionModel, collision_model
from armdyn.optimal.path_constraints.clearance.clearance import ClearanceConstraint, scene_of
from armdyn.optimal.path_constraints.clearance.pairs import Pair, PairRows
from armdyn.optimal.problem.problem import MinimumTimeProblem

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Obstacles(ClearanceConstraint):
    """The arm keeps clear of `problem.obstacles`."""

    name = "obstacles"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return cls() if problem.obstacles else None

    def pairs(self, problem: MinimumTimeProblem) -> tuple[Pair, ...]:
        """Every capsule that moves against every obstacle."""
        arm = [(name, joint, capsule) for name, joint, capsule in capsules(problem.robot) if joint]
        return tuple(Pair(*own, k) for own in arm for k in range(len(problem.obstacles)))

    def model(self, problem: MinimumTimeProblem) -> CollisionModel:
        """Arm and obstacles."""
        return collision_model(problem.robot, tuple(problem.obstacles), False)

    def _rows(self, problem: MinimumTimeProblem) -> PairRows:
        return PairRows(self.pairs(problem), tuple(map(type, problem.obstacles)))

    def _scene(self, problem: MinimumTimeProblem) -> Array:
        return scene_of(problem)
