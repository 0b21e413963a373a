"""Margins within a problem's limits, for a mesh's motion that exceeds them between its points."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from armdyn.optimal.landing.limit_violations import excesses
from armdyn.optimal.proof.certificate import LIMIT_TOLERANCE
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.task.task import Task

_ROUNDING = 1e-12
"""Part of a velocity limit by which the reserve at an end's velocity may be rounded."""


@dataclass(frozen=True)
class MeshMargins:
    """Margins by which a mesh's motion stays within its limits, for excesses between knots and for feedback.

    Attributes:
        velocity: margin of velocities, as a part of the limits.
        position: margin of positions, as a part of the joints' ranges.
        torque: margin of torques, as a part of the limits.
    """

    velocity: float = 0.0
    position: float = 0.0
    torque: float = 0.0

    def task_within(self, task: Task) -> Task:
        """The task with limits reduced by the margins, as far as both ends allow."""
        problem, limits, reserves = task.problem, task.problem.limits, task.problem.reserves
        weak = np.where(limits.actuators.lower * limits.actuators.upper < 0, self.torque, 0.0)
        fastest = np.max(np.abs([problem.x_start, problem.x_goal]), axis=0)[problem.robot.nv :]
        spare = np.clip(1 - (1 + _ROUNDING) * fastest / limits.velocity, 0.0, 1.0)
        whole = limits.position_upper - limits.position_lower
        room = self.position * np.where(np.isfinite(whole), whole, 1.0)  # 1 rad, as in `excesses`
        lower, upper = limits.position_lower + room, limits.position_upper - room
        within = problem.variant(
            velocity_reserve=reserves.velocity + (1 - reserves.velocity) * np.minimum(self.velocity, spare),
            reserve=reserves.effort + (1 - reserves.effort) * weak,
            position_limit=(
                np.where(np.all(problem.poses > lower, axis=0), lower, limits.position_lower),
                np.where(np.all(problem.poses < upper, axis=0), upper, limits.position_upper),
            ),
        )
        return replace(task, problem=within)

    def wider(self, task: Task, optimum: Optimum, torque: float = 0.0) -> Self:
        """Margins wider by an optimum's excesses.

        Args:
            task: the problem and its settings.
            optimum: motion of a mesh with these margins.
            torque: the new margin of torques, as a part of the limits.
        """
        velocity, position = excess(task, optimum)
        return type(self)(self.velocity + velocity, self.position + position, torque)


def excess(task: Task, optimum: Optimum) -> tuple[float, float]:
    """Excess over limits of velocity and of position, as parts of these; 0 for positions within tolerance."""
    _, velocity, position = (one.share for one in excesses(task.problem.limits, optimum.trajectory))
    return velocity, position if position > LIMIT_TOLERANCE else 0.0
