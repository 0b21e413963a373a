"""Velocity limits that fall to zero towards the ends of the joints' ranges, as for Franka Research 3."""

from dataclasses import dataclass
from typing import Self

import casadi as ca
import numpy as np

from armdyn.arrays import Array
from armdyn.models.presets.interface import REST_VELOCITY, VelocityTaper
from armdyn.optimal.path_constraints.constraint import ConstraintReport
from armdyn.optimal.path_constraints.limits.rates import PartialLimit, times_within
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages
from armdyn.trajectory import Trajectory


@dataclass(frozen=True)
class VelocityTaperLimit(PartialLimit):
    """The velocity limits by position of the problem's preset.

    √(c (u - q)) - b ≥ v is q + max(0, v + b)² / c ≤ u: convex, and smooth.
    """

    name = "velocity limits by position"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return None if problem.preset is None or problem.preset.taper is None else cls()

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of the tapered velocity limits at the stages of every interval, over the joints' ranges."""
        return (StageRows(_beyond, numbers=4 * problem.robot.nv + 1),)

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        taper = _taper(problem)
        return (RowValues(-np.inf, 0.0, np.array([*taper.lower, *taper.upper, *taper.gain, *taper.offset, self.part])),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check tapered velocities at five points of every sample."""
        t = times_within(motion)
        at = motion(t)
        lower, upper = _taper(problem).at(at.q)
        shares = np.abs(at.v) / np.maximum(np.where(at.v < 0, -lower, upper), REST_VELOCITY)
        k, i = np.unravel_index(np.argmax(shares), shares.shape)
        share, joint, when = float(shares[k, i]), problem.robot.joint_names[i], float(t[k])
        words = f"{abs(at.v[k, i]):.5g} rad/s at {at.q[k, i]:.4g} rad, by {joint!r} at t = {when:.4g} s"
        beyond = f"exceeds its velocity limit at {at.q[k, i]:.4g} rad by {100 * (share - 1):.2g} %"
        reason = f"joint {joint!r} {beyond} at t = {when:.4g} s"
        return self.report(share, words, reason, ("velocity limit by position", joint, when))


def _taper(problem: MinimumTimeProblem) -> VelocityTaper:
    assert problem.preset is not None and problem.preset.taper is not None  # noqa: S101  # checked by `from_problem`
    return problem.preset.taper


def _beyond(stages: Stages, numbers: ca.SX) -> ca.SX:
    """Excess of positions over the largest ones allowed at their velocities, over the joints' ranges."""
    n = stages.effort.numel()
    lower, upper, gain, offset, part = ca.vertsplit(numbers, [0, n, 2 * n, 3 * n, 4 * n, 4 * n + 1])
    first = 1 if all(stages.knots) else 0  # that stage is the last of the interval before
    rows = []
    for k in range(first, stages.c.size):
        q, v = stages.q[:, k], stages.v[:, k] / part
        rows += [
            (side + ca.fmax(0, speed + offset) ** 2 / gain) / (upper - lower)
            for side, speed in ((q - upper, v), (lower - q, -v))
        ]
    return ca.vertcat(*rows)
