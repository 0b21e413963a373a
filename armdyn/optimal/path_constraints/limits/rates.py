"""Accelerations and jerks along a replay; limits that are tightened by a common factor."""

from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.optimal.path_constraints.constraint import ConstraintReport, PathConstraint
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.tableau import differentiation, lagrange
from armdyn.trajectory import Trajectory

_POINTS = (1 - np.cos(np.pi * np.arange(5) / 4)) / 2
"""Chebyshev points of a sample, including its ends."""
_PLACES = np.linspace(0, 1, 17)
"""Points of a sample at which the polynomial is evaluated: 16 per sample, a sample being 1e-3 of the motion."""
_VALUES = lagrange(_POINTS, _PLACES)
_SLOPES = _VALUES @ differentiation(_POINTS)


def times_within(motion: Trajectory) -> Array:
    """Five evenly spaced times [s] in every sample that is no jump of the torque, shape (5 samples,)."""
    steps = np.diff(motion.t)[:, None]
    return np.asarray((motion.t[:-1, None] + steps * np.linspace(0, 1, 5))[~motion.jumps].ravel())


def accelerations(robot: Robot, motion: Trajectory) -> tuple[Array, Array, Array]:
    """Accelerations and jerks along a replay, also between samples.

    Within a sample the torque is linear and the acceleration smooth: the polynomial through `aba` at five Chebyshev
    points. At a sample the jerk has a value on either side.

    Args:
        robot: the robot.
        motion: replay of the robot.

    Returns:
        Times [s], shape (pieces, places), accelerations [rad/s² or m/s²] and jerks [rad/s³ or m/s³] there, each
        of shape (pieces, places, nv).
    """
    flows = ~motion.jumps
    start, steps = motion.t[:-1][flows], np.diff(motion.t)[flows]
    t = start[:, None] + steps[:, None] * _POINTS
    at = motion(t)
    # At a sample's end the torque is the one before a jump.
    tau = motion.tau[:-1][flows][:, None] + _POINTS[:, None] * np.diff(motion.tau, axis=0)[flows][:, None]
    a = forward_dynamics(robot)(at.q, at.v, tau)
    jerks = _SLOPES @ a / steps[:, None, None]
    return start[:, None] + steps[:, None] * _PLACES, _VALUES @ a, jerks


@dataclass(frozen=True)
class PartialLimit(PathConstraint):
    """Limit of a rate; the program satisfies a part of it, so that the replay satisfies the whole between the points.

    Attributes:
        part: part of the limit in the program, lowered by `tightened`.
    """

    part: float = field(default=1.0, kw_only=True)

    def tightened(self, problem: MinimumTimeProblem, report: ConstraintReport) -> Self:
        """Lower the limit by the replay's excess; raise it again if the replay stays below."""
        spare = self.policy.rate_tightening if report.reasons else 0.0
        part = (1 - spare) * self.part / max(float(report.share or 1), 1e-6)
        fitting = float(np.clip(part, self.policy.least_part, 1))
        return replace(self, part=fitting) if report.reasons or fitting > self.part else self

    def on_finer_mesh(self) -> Self:
        """Restore the whole limit: on a mesh twice as fine the excess between the points is much smaller."""
        return replace(self, part=1.0)
