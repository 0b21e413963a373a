"""Limits of torques beyond their range: rates, torque-speed curves, and RMS values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import number
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.models.values.per_joint import filled, per_joint
from armdyn.optimal.constraints.constraint import ConstraintReport, PartialLimit, PathConstraint
from armdyn.optimal.constraints.rows import StageRows, Stages
from armdyn.optimal.problem.checks import held
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.parsing.numbers import number as parsed
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory


@brief
@dataclass(frozen=True, eq=False)
class TorqueRateLimit(PathConstraint):
    """Limits of the torque rates.

    At an end at rest the torque is the holding torque, if the actuator can supply it.

    Attributes:
        limit: largest torque rate [N m/s or N/s]: one number, or one per joint; inf for none.
    """

    limit: ArrayLike

    name = "torque-rate limits"
    of_torques = True
    continuous_torque = True
    option, metavar, help = (
        "torque-rate",
        "R[,R…]",
        "how fast torques may change [N m/s], one number or one per joint",
    )

    def __post_init__(self) -> None:
        per_joint(self.limit, None, "TorqueRateLimit", unit="N m/s", error=ProblemError, finite=False)

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        limit = None if problem.preset is None else problem.preset.limit("torque_rate")
        return None if limit is None else cls(limit)

    @classmethod
    def of_option(cls, values: list[float], frame: str | None = None) -> Self:
        """Parse one number, or one per joint."""
        values, frame = cls._option_parts(values, frame)
        if frame is not None:
            raise ProblemError(f"--limit {cls.option}: it limits joints, not frame {frame!r}; leave @{frame} out")
        return cls(values[0] if len(values) == 1 else values)

    def option_text(self) -> str:
        """Text of the constraint for its option, with all digits."""
        return f"{self.option}={_text(self.limit)}"

    def on(self, robot: Robot, start: Array, goal: Array) -> Self:
        """Expand the limit to one positive number per joint."""
        return type(self)(_per_joint(self.limit, robot, "TorqueRateLimit", "N m/s"))

    def torque_rate_limit(self, problem: MinimumTimeProblem) -> Array:
        return np.asarray(self.limit)

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rates in every interval over the limits; the torques at both ends, free if none can hold the arm there."""
        (start, begins), (goal, ends) = (self._held(problem, x) for x in (problem.x_start, problem.x_goal))
        return (
            StageRows(_rates, -1, 1, 1 / np.asarray(self.limit)),
            StageRows(_from_torque, -begins, begins, start, (0.0,), "first"),
            StageRows(_from_torque, -ends, ends, goal, (1.0,), "last"),
        )

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check rates between consecutive samples, where the replay's torques are linear."""
        # A jump of the torque takes less time than a number can resolve.
        rates, robot = np.abs(np.diff(motion.tau, axis=0)) / np.diff(motion.t)[:, None], problem.robot
        limit = np.broadcast_to(np.asarray(self.limit), rates.shape[1:])

        def words(k: int, i: int) -> str:
            return f"{rates[k, i]:.5g} of {limit[i]:.5g} {'N/s' if robot.slides[i] else 'N m/s'} at most"

        report = self._report_of_joints(problem, rates / limit, motion.t, words, "torque-rate limit")
        if report.worst is not None:
            joint, share = report.worst.joint, 1 + report.worst.value
            reason = f"the torque of joint {joint!r} changes {share:.4g} times as fast as its limit allows"
            report = replace(report, reasons=(reason,))
        states = problem.x_start, problem.x_goal
        ends = zip(states, motion.t[[0, -1]], motion.tau[[0, -1]], ("begins", "ends"), strict=True)
        for x, t, tau, end in ends:
            hold, free = self._held(problem, x)
            jump = np.where(free > 0, 0, np.abs(tau - hold)) / problem.limits.actuators.scale
            largest, joint = float(np.max(jump)), robot.joint_names[int(np.argmax(jump))]
            if largest > self.policy.tolerance:
                found = Violation("jump of the torque", joint, float(t), largest)
                worst = found if report.worst is None or largest > report.worst.value else report.worst
                reasons = *report.reasons, f"the torque {end} with a jump of {100 * largest:.2g} % of its limit"
                report = replace(report, reasons=reasons, worst=worst, order=0)
        return report

    def _held(self, problem: MinimumTimeProblem, x: Array) -> tuple[Array, Array]:
        """Holding torques in a state [N m or N], and the allowed distance from them: 0, or inf if a torque is free."""
        hold, supplied = held(problem.robot, problem.limits, *np.split(x, 2))
        return hold, np.where(supplied & np.isfinite(self.limit), 0.0, np.inf)


def _torque_change(stages: Stages) -> ca.SX:
    """Change of the torque over the interval [N m or N]; the torque is linear in it."""
    return ca.SX((stages.tau[:, -1] - stages.tau[:, 0]) / (stages.c[-1] - stages.c[0]))


def _rates(stages: Stages, over_limit: ca.SX) -> ca.SX:
    return ca.SX(_torque_change(stages) / stages.h * over_limit)


def _from_torque(stages: Stages, hold: ca.SX, part: float) -> ca.SX:
    """Difference of the torque from a given one at a fraction of the interval, over its scale."""
    return ca.SX((stages.tau[:, 0] + (part - stages.c[0]) * _torque_change(stages) - hold) / stages.effort)


@dataclass(frozen=True)
class TorqueSpeedLimit(PartialLimit):
    """The lines |τ + s v| ≤ c of the problem's actuators; curves satisfy them without rows of their own."""

    name = "torque-speed curves"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return cls() if problem.limits.actuators.lines[0].size else None

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of the torque-speed lines at the stages of every interval, over c; torques are continuous at knots."""
        slopes, rest = problem.limits.actuators.lines
        inner = StageRows(_lines, -self.part, self.part, np.append(1 / rest, slopes / rest), (len(slopes), True))
        return inner, replace(inner, arguments=(len(slopes), False), where="first")

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check torques at the samples, between which they are linear."""
        slopes, rest = problem.limits.actuators.lines
        used = np.max(np.abs(motion.tau[:, None] + slopes * motion.v[:, None]) / rest, axis=1)

        def words(k: int, i: int) -> str:
            return f"{100 * used[k, i]:.4g} % of its line used at most"

        return self._report_of_joints(problem, used, motion.t, words, "torque-speed curve")


def _lines(stages: Stages, numbers: ca.SX, lines: int, inner: bool) -> ca.SX:
    """(τ + s v) / c at the stages except the first, which is the last of the interval before, or at that alone."""
    n, count = stages.effort.numel(), stages.c.size
    torque, speed = (ca.reshape(half, n, lines) for half in ca.vertsplit(numbers, n * lines))
    used = [torque * stages.tau[:, i] + speed * stages.v[:, i] for i in range(count)]
    return ca.vec(ca.horzcat(*(used[1:] if inner else used[:1])))


@brief
@dataclass(frozen=True, eq=False)
class RmsTorque(PartialLimit):
    """Limit of each joint's root mean square of the torque over the motion and a dwell at the goal.

    ∫ τ² dt + dwell τ_h² ≤ limit² (T + dwell); in the dwell the motors hold the arm with the torque τ_h. Gravity and
    friction are part of τ.

    Attributes:
        limit: continuous torque [N m or N]: one number, or one per joint; inf for none.
        dwell: time at rest at the goal [s].
    """

    limit: ArrayLike
    dwell: float = 0.0

    name = "continuous-torque limits"
    of_torques = True
    option, metavar, help = (
        "rms-torque",
        "L[,L…][@DWELL]",
        "root mean square of the torques [N m] over the motion and a dwell [s], one number or one per joint",
    )

    def __post_init__(self) -> None:
        per_joint(self.limit, None, "RmsTorque limit", unit="N m", error=ProblemError, finite=False)
        number(self.dwell, "RmsTorque dwell", unit="s", sign="not negative")

    @classmethod
    def of_option(cls, values: list[float], frame: str | None = None) -> Self:
        """Parse the option: one number, or one per joint; after @ the dwell."""
        values, frame = cls._option_parts(values, frame)
        dwell = 0.0 if frame is None else parsed(frame.removesuffix("s"), f"--limit {cls.option}: the dwell after @")
        return cls(values[0] if len(values) == 1 else values, dwell)

    def option_text(self) -> str:
        """Text of the constraint for its option, with all digits."""
        dwell = f"@{float(self.dwell)!r}" if self.dwell else ""
        return f"{self.option}={_text(self.limit)}{dwell}"

    def on(self, robot: Robot, start: Array, goal: Array) -> Self:
        """Expand the limit to one number per joint, and check that the goal of a dwell is at rest."""
        limit = _per_joint(self.limit, robot, "RmsTorque limit", "N m")
        if self.dwell and np.any(goal[robot.nv :]):
            raise ProblemError(f"RmsTorque has a dwell of {self.dwell:g} s at the goal, where the arm is in flight")
        return replace(self, limit=limit)

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """∫ ((τ/limit)² - part²) dt [s] of every joint."""
        square = self.part**2
        left = self.dwell * (square - self._held(problem))
        numbers = np.append(np.asarray(self.limit, dtype=float) ** -2, square)
        return (StageRows(_surplus, -np.inf, left, numbers, where="sum"),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check the integral of the replay's torques, linear between samples."""
        tau, steps = motion.tau / np.asarray(self.limit), np.diff(motion.t)
        heat = steps @ (tau[1:] ** 2 + tau[1:] * tau[:-1] + tau[:-1] ** 2) / 3 + self.dwell * self._held(problem)
        used = np.sqrt(heat / (motion.duration + self.dwell))
        i = int(np.argmax(used))
        share, joint, most = float(used[i]), problem.robot.joint_names[i], float(np.asarray(self.limit)[i])
        words = f"{share * most:.5g} of {most:.5g} {'N' if problem.robot.slides[i] else 'N m'} at most, by {joint!r}"
        reason = f"the root mean square of the torque of joint {joint!r} exceeds its limit by {100 * (share - 1):.2g} %"
        return self.report(share, words, reason, ("continuous-torque limit", joint, float(motion.t[-1])))

    def _held(self, problem: MinimumTimeProblem) -> Array:
        """Squared holding torques at the goal over squared limits, shape (nv,)."""
        return np.asarray(problem.holding_torque() / np.asarray(self.limit)) ** 2


def _surplus(stages: Stages, numbers: ca.SX) -> ca.SX:
    """∫ ((τ/limit)² - part²) dt over an interval, in which the torque is linear."""
    slope = _torque_change(stages)
    first = stages.tau[:, 0] - float(stages.c[0]) * slope
    last = first + slope
    return ca.SX(stages.h * ((first**2 + first * last + last**2) / 3 * numbers[:-1] - numbers[-1]))


def _per_joint(limit: ArrayLike, robot: Robot, what: str, unit: str) -> Array:
    """A limit of one positive number, or one per joint, expanded to shape (nv,); inf: none."""
    limit = filled(limit, robot.joint_names, what, np.inf, ProblemError)
    return per_joint(limit, robot.joint_names, what, unit=unit, error=ProblemError, finite=False, sign="positive")


def _text(limit: ArrayLike) -> str:
    return ",".join(map(repr, np.ravel(limit).tolist()))
