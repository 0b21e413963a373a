"""Torque limits that fall with speed: torque-speed curves of motors."""

from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.optimal.path_constraints.constraint import ConstraintReport
from armdyn.optimal.path_constraints.limits.rates import PartialLimit
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages
from armdyn.trajectory import Trajectory


@dataclass(frozen=True)
class TorqueSpeedLimit(PartialLimit):
    """The lines |τ + s v| ≤ c of the problem's actuators; curves satisfy them without rows of their own."""

    name = "torque-speed curves"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return cls() if problem.limits.actuators.lines[0].size else None

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of the torque-speed lines at the stages of every interval, over c; torques are continuous at knots."""
        slopes, _ = problem.limits.actuators.lines
        count, numbers = len(slopes), 2 * slopes.size
        return StageRows(_lines, (count, True), numbers), StageRows(_lines, (count, False), numbers, "first")

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        slopes, rest = problem.limits.actuators.lines
        own = RowValues(-self.part, self.part, np.concatenate([(1 / rest).ravel(), (slopes / rest).ravel()]))
        return own, own

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check torques at the samples, between which they are linear."""
        slopes, rest = problem.limits.actuators.lines
        used = np.max(np.abs(motion.tau[:, None] + slopes * motion.v[:, None]) / rest, axis=1)
        k, i = np.unravel_index(np.argmax(used), used.shape)
        share, joint, when = float(used[k, i]), problem.robot.joint_names[i], float(motion.t[k])
        words = f"{100 * share:.4g} % of its line used at most, by {joint!r} at t = {when:.4g} s"
        reason = f"joint {joint!r} exceeds its torque-speed curve by {100 * (share - 1):.2g} % at t = {when:.4g} s"
        return self.report(share, words, reason, ("torque-speed curve", joint, when))


def _lines(stages: Stages, numbers: ca.SX, lines: int, inner: bool) -> ca.SX:
    """(τ + s v) / c at the stages except a first one that is a knot, or at the first one alone."""
    n, count = stages.effort.numel(), stages.c.size
    torque, speed = (ca.reshape(half, n, lines) for half in ca.vertsplit(numbers, n * lines))
    used = [torque * stages.tau[:, i] + speed * stages.v[:, i] for i in range(count)]
    return ca.vec(ca.horzcat(*(used[int(stages.knots[0]) :] if inner else used[:1])))
