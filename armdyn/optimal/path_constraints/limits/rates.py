"""Accelerations and jerks along a replayed motion; limits that are tightened as a whole, and reports on them."""

from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from armdyn.arrays import Array
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.models.robots.robot import Robot
from armdyn.optimal.path_constraints.constraint import ConstraintReport, PathConstraint
from armdyn.optimal.path_constraints.rows import RowValues
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.task.tableau import differentiation, lagrange
from armdyn.trajectory import Trajectory

_DERIVATIVES = {2: ("acceleration", "²"), 3: ("jerk", "³")}
_POINTS = (1 - np.cos(np.pi * np.arange(5) / 4)) / 2
"""Chebyshev's points of a sample, its ends among them."""
_PLACES = np.linspace(0, 1, 17)
"""Of a sample, at which the polynomial is looked at: 16 parts of the 1e-3 that a sample is of the motion."""
_VALUES = lagrange(_POINTS, _PLACES)
_SLOPES = _VALUES @ differentiation(_POINTS)


def times_within(motion: Trajectory) -> Array:
    """Five times evenly within every sample that is no jump of the torque [s], shape (5 samples,)."""
    steps = np.diff(motion.t)[:, None]
    return np.asarray((motion.t[:-1, None] + steps * np.linspace(0, 1, 5))[~motion.jumps].ravel())


def accelerations(robot: Robot, motion: Trajectory) -> tuple[Array, Array, Array]:
    """Accelerations and jerks along a replay, also between its samples.

    Within a sample the torque is linear and the acceleration smooth: it is the polynomial through its values at five
    Chebyshev points, by `aba`. At a sample the jerk has a value on either side.

    Args:
        robot: that moves.
        motion: its replay.

    Returns:
        Times [s], shape (pieces, places), accelerations [rad/s² or m/s²] and jerks [rad/s³ or m/s³] there, each
        of shape (pieces, places, nv).
    """
    flows = ~motion.jumps
    start, steps = motion.t[:-1][flows], np.diff(motion.t)[flows]
    t = start[:, None] + steps[:, None] * _POINTS
    at = motion(t)
    # At its end a sample's torque is its own, not that after the jump.
    tau = motion.tau[:-1][flows][:, None] + _POINTS[:, None] * np.diff(motion.tau, axis=0)[flows][:, None]
    a = forward_dynamics(robot)(at.q, at.v, tau)
    jerks = _SLOPES @ a / steps[:, None, None]
    return start[:, None] + steps[:, None] * _PLACES, _VALUES @ a, jerks


@dataclass(frozen=True)
class PartialLimit(PathConstraint):
    """A limit of a rate; the program keeps a part of it, so that the replay keeps the whole between the points.

    Attributes:
        part: of the limit, that the program is asked to keep: `tightened` lowers it.
    """

    part: float = field(default=1.0, kw_only=True)

    def tightened(self, problem: MinimumTimeProblem, report: ConstraintReport) -> Self:
        """Lower the limit by the replay's excess; raise it again where the replay stays below."""
        spare = self.policy.rate_spare if report.reasons else 0.0
        part = (1 - spare) * self.part / max(float(report.share or 1), 1e-6)
        fitting = float(np.clip(part, self.policy.least_part, 1))
        return replace(self, part=fitting) if report.reasons or fitting > self.part else self

    def on_finer_mesh(self) -> Self:
        """The whole limit again: the excess between the points of a mesh twice as fine is a fraction."""
        return replace(self, part=1.0)


@dataclass(frozen=True)
class DerivativeLimit(PartialLimit):
    """Limits of a derivative of the joint positions, for which a problem has a keyword.

    Attributes:
        order: of the derivative: 2, acceleration, or 3, jerk.
    """

    order: ClassVar[int]

    @classmethod
    def limits(cls, problem: MinimumTimeProblem) -> Array | None:
        """The derivative's limits [rad/s² or m/s², or rad/s³ or m/s³], shape (nv,); None: there are none."""
        given = getattr(problem, f"{_DERIVATIVES[cls.order][0]}_limit")
        return None if given is None else np.asarray(given)

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return None if cls.limits(problem) is None else cls()

    def derivative_limit(self, problem: MinimumTimeProblem) -> tuple[int, Array]:
        return self.order, self.part * np.asarray(self.limits(problem))

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        return (RowValues(-self.part, self.part, 1 / np.asarray(self.limits(problem))),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check accelerations by forward dynamics, jerks by their time derivative, within every sample."""
        robot, limits, (what, power) = problem.robot, np.asarray(self.limits(problem)), _DERIVATIVES[self.order]
        t, *rates = accelerations(robot, motion)
        seen = np.abs(rates[self.order - 2]).reshape(-1, robot.nv)
        k, i = np.unravel_index(np.argmax(seen / limits), seen.shape)
        share, joint, when = float(seen[k, i] / limits[i]), robot.joint_names[i], float(t.ravel()[k])
        unit = f"{'m' if robot.slides[i] else 'rad'}/s{power}"
        words = f"{seen[k, i]:.5g} of {limits[i]:.5g} {unit} at most, by {joint!r} at t = {when:.4g} s"
        reason = f"joint {joint!r} exceeds its {what} limit by {100 * (share - 1):.2g} % at t = {when:.4g} s"
        return self.report(share, words, reason, (f"{what} limit", joint, when), order=self.order)
