"""The arm's links keep clear of each other."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from armdyn.dynamics.symbolic import Dynamics
from armdyn.locks import built_once
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.bodies import capsules
from armdyn.models.scene.collision import CollisionModel, collision_model
from armdyn.optimal.path_constraints.clearance.clearance import ClearanceConstraint
from armdyn.optimal.path_constraints.clearance.pairs import Pair, distances_at
from armdyn.optimal.problem.problem import MinimumTimeProblem


@dataclass(frozen=True, eq=False)
class SelfCollision(ClearanceConstraint):
    """Links that need not touch keep clear of each other."""

    name = "self-collision"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return cls() if problem.self_collision else None

    def pairs(self, problem: MinimumTimeProblem) -> tuple[Pair, ...]:
        """Capsules of links that must be apart, and are at the given poses."""
        return _pairs(problem.robot, problem.poses.tobytes())

    def model(self, problem: MinimumTimeProblem) -> CollisionModel:
        """The arm alone."""
        return collision_model(problem.robot, (), True)


@built_once(maxsize=16)
def _pairs(robot: Robot, poses: bytes) -> tuple[Pair, ...]:
    arm = capsules(robot)
    apart = {frozenset(names) for names in collision_model(robot, (), True).pairs}
    own = [
        Pair(name, joint, capsule, other, other_joint, other_name)
        for i, (name, joint, capsule) in enumerate(arm)
        for other_name, other_joint, other in arm[:i]
        if frozenset((name, other_name)) in apart and joint != other_joint
    ]
    function = distances_at(Dynamics(robot, free_last_body=True), tuple(own))
    given = [np.array(function(q, ())).ravel() for q in np.frombuffer(poses).reshape(-1, robot.nv)]
    # Round capsules around links that are near each other by design overlap: the real bodies are checked.
    return tuple(pair for pair, near in zip(own, np.min(given, axis=0), strict=True) if near > 0)
