"""Limits of rates: of joints, also by their positions, and the speed of a frame."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import casadi as ca
import numpy as np
import pinocchio as pin

from armdyn.arguments import number, text
from armdyn.arrays import Array
from armdyn.dynamics.numeric import forward_dynamics
from armdyn.errors import ProblemError, SpecError, reraised
from armdyn.models.presets.interface import REST_VELOCITY, VelocityTaper
from armdyn.models.robots.robot import Robot
from armdyn.optimal.constraints.constraint import ConstraintReport, PartialLimit
from armdyn.optimal.constraints.rows import StageRows, Stages
from armdyn.optimal.problem.checks import SLOWEST
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.trajectory import Trajectory

_DERIVATIVES = {2: ("acceleration", "²"), 3: ("jerk", "³")}
_POINTS = (1 - np.cos(np.pi * np.arange(5) / 4)) / 2
"""Chebyshev points of a sample, including its ends."""
_PLACES = np.linspace(0, 1, 17)
"""Points of a sample at which the polynomial is evaluated: 16 per sample, a sample being 1e-3 of the motion."""
_POWERS = np.arange(_POINTS.size)
_VALUES = _PLACES[:, None] ** _POWERS @ np.linalg.inv(_POINTS[:, None] ** _POWERS)
"""Values at the places of the polynomial through values at the points, shape (places, points)."""
_SLOPES = _POWERS[1:] * _PLACES[:, None] ** _POWERS[:-1] @ np.linalg.inv(_POINTS[:, None] ** _POWERS)[1:]
"""Likewise its derivatives."""


def times_within(motion: Trajectory) -> Array:
    """Evenly spaced times [s], as many as `_POINTS`, in every sample that is no jump of the torque, shape (m,)."""
    steps = np.diff(motion.t)[:, None]
    return np.asarray((motion.t[:-1, None] + steps * np.linspace(0, 1, _POINTS.size))[~motion.jumps].ravel())


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
class DerivativeLimit(PartialLimit):
    """Limits of a derivative of the joint positions, from an argument of the problem.

    Attributes:
        order: order of the derivative: 2, acceleration, or 3, jerk.
    """

    order: ClassVar[int]

    def limits(self, problem: MinimumTimeProblem) -> Array:
        """The derivative's limits [rad/s² or m/s², or rad/s³ or m/s³], shape (nv,)."""
        return problem.rates[self.order - 2]

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return None if getattr(problem, f"{_DERIVATIVES[cls.order][0]}_limit") is None else cls()

    def derivative_limit(self, problem: MinimumTimeProblem) -> tuple[int, Array]:
        return self.order, self.part * self.limits(problem)

    def _within(self, problem: MinimumTimeProblem, expression: Callable[..., ca.SX]) -> StageRows:
        """Rows of the derivative over its limits."""
        return StageRows(expression, -self.part, self.part, 1 / self.limits(problem))

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check accelerations by forward dynamics, and their time derivatives, within every sample."""
        robot, limits, (kind, power) = problem.robot, self.limits(problem), _DERIVATIVES[self.order]
        t, *rates = accelerations(robot, motion)
        seen = np.abs(rates[self.order - 2]).reshape(-1, robot.nv)

        def words(k: int, i: int) -> str:
            return f"{seen[k, i]:.5g} of {limits[i]:.5g} {'m' if robot.slides[i] else 'rad'}/s{power} at most"

        return self._report_of_joints(problem, seen / limits, t.ravel(), words, f"{kind} limit", self.order)


@dataclass(frozen=True)
class AccelerationLimit(DerivativeLimit):
    """No joint accelerates by more than `problem.acceleration_limit`."""

    name = "acceleration limits"
    order = 2

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of accelerations at the stages of every interval, over the limits."""
        return (self._within(problem, _accelerations),)

    def least_duration(self, problem: MinimumTimeProblem, q: Array, dq: Array, ddq: Array) -> float:
        return float(np.sqrt(np.max(np.abs(ddq) / self.limits(problem))))


def _accelerations(stages: Stages, over_limit: ca.SX) -> ca.SX:
    return ca.vec(stages.a * ca.repmat(over_limit, 1, stages.a.shape[1]))


@dataclass(frozen=True)
class JerkLimit(DerivativeLimit):
    """No joint's jerk exceeds `problem.jerk_limit`; before and after the motion the acceleration is zero."""

    name = "jerk limits"
    order = 3
    continuous_torque = True

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Differences of accelerations between stages over the limits; the accelerations at both ends."""
        return (
            self._within(problem, _jerks),
            StageRows(_acceleration_at, 0, 0, arguments=(0,), where="first"),
            StageRows(_acceleration_at, 0, 0, arguments=(-1,), where="last"),
        )


def _jerks(stages: Stages, over_limit: ca.SX) -> ca.SX:
    steps = ca.repmat(ca.DM(np.diff(stages.c)).T, over_limit.numel(), 1)
    rises = (stages.a[:, 1:] - stages.a[:, :-1]) / (steps * stages.h)
    return ca.vec(rises * ca.repmat(over_limit, 1, steps.shape[1]))


def _acceleration_at(stages: Stages, numbers: ca.SX, stage: int) -> ca.SX:
    return ca.SX(stages.a[:, stage] / stages.acceleration)


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
        taper = _taper(problem)
        numbers = np.array([*taper.lower, *taper.upper, *taper.gain, *taper.offset, self.part])
        return (StageRows(_beyond, -np.inf, 0.0, numbers),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check tapered velocities at five points of every sample."""
        t = times_within(motion)
        at = motion(t)
        lower, upper = _taper(problem).at(at.q)
        shares = np.abs(at.v) / np.maximum(np.where(at.v < 0, -lower, upper), REST_VELOCITY)

        def words(k: int, i: int) -> str:
            return f"{abs(at.v[k, i]):.5g} rad/s at {at.q[k, i]:.4g} rad"

        return self._report_of_joints(problem, shares, t, words, "velocity limit by position")


def _taper(problem: MinimumTimeProblem) -> VelocityTaper:
    assert problem.preset is not None and problem.preset.taper is not None  # noqa: S101  # checked by `from_problem`
    return problem.preset.taper


def _beyond(stages: Stages, numbers: ca.SX) -> ca.SX:
    """Distances beyond the positions at which the velocities are just allowed, as parts of the ranges; allowed up to 0.

    Args:
        stages: stages of an interval.
        numbers: lower, upper, gain and offset of the taper, and the tightened part of the limits, shape (4 nv + 1,).
    """
    n = stages.effort.numel()
    lower, upper, gain, offset, part = ca.vertsplit(numbers, [0, n, 2 * n, 3 * n, 4 * n, 4 * n + 1])
    # The first stage is the last of the interval before.
    rows = []
    for k in range(1, stages.c.size):
        q, v = stages.q[:, k], stages.v[:, k] / part
        rows += [
            (side + ca.fmax(0, speed + offset) ** 2 / gain) / (upper - lower)
            for side, speed in ((q - upper, v), (lower - q, -v))
        ]
    return ca.vertcat(*rows)


@dataclass(frozen=True)
class FrameSpeedLimit(PartialLimit):
    """Limit of the speed of a frame's origin in the world.

    Attributes:
        limit: largest speed [m/s].
        frame: name of the frame; None: the robot's tip.
    """

    limit: float
    frame: str | None = None

    name = "frame speed limits"
    option, metavar, help = "tip-speed", "V[@FRAME]", "how fast a frame may move [m/s], by default the tip"

    def __post_init__(self) -> None:
        if number(self.limit, "FrameSpeedLimit", unit="m/s", sign="positive") < SLOWEST:
            raise ProblemError(f"FrameSpeedLimit is {self.limit} m/s; it must be {SLOWEST:g} m/s at least")
        number(self.part, "part of FrameSpeedLimit", sign="positive")
        if self.frame is not None:
            text(self.frame, "frame of FrameSpeedLimit")

    @classmethod
    def of_option(cls, values: list[float], frame: str | None = None) -> Self:
        """The constraint from an option's number and frame."""
        values, frame = cls._option_parts(values, frame)
        if len(values) != 1:
            raise ProblemError(f"--limit {cls.option} has {len(values)} numbers; give one, and it again per frame")
        return cls(values[0], frame)

    def option_text(self) -> str:
        """Text of the constraint for its option, with all digits."""
        return f"{self.option}={float(self.limit)!r}" + (f"@{self.frame}" if self.frame else "")

    def on(self, robot: Robot, start: Array, goal: Array) -> Self:
        """Resolve the frame's name, and check the limit at start and goal."""
        frame = robot.tip if self.frame is None else self.frame
        with reraised(ProblemError, "FrameSpeedLimit", SpecError):
            fixed = robot.frame(frame)
        if fixed.parentJoint == 0:
            raise ProblemError(f"FrameSpeedLimit: frame {frame!r} of {robot.name} does not move; give another")
        for x, end in ((start, "start"), (goal, "goal")):
            (speed,) = _speeds(robot, frame, x[None, : robot.nv], x[None, robot.nv :])
            if speed > self.limit:
                raise ProblemError(
                    f"at the {end} frame {frame!r} moves at {speed:.4g} m/s, faster than FrameSpeedLimit {self.limit:g}"
                )
        return replace(self, frame=frame)

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Squared speeds at the stages of every interval, over the squared limit."""
        return (StageRows(_squares, -np.inf, self.part**2, [self.limit**-2], (self.frame,)),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check speeds by Pinocchio, at five points of every sample."""
        t, n = times_within(motion), problem.robot.nv
        at = motion(t)
        speeds = _speeds(problem.robot, str(self.frame), at.q.reshape(-1, n), at.v.reshape(-1, n))
        when, share = float(t[np.argmax(speeds)]), float(np.max(speeds)) / self.limit
        words = f"{np.max(speeds):.5g} m/s at most, at t = {when:.4g} s"
        reason = f"frame {self.frame!r} moves at {words}; the limit is {self.limit:g} m/s"
        worst = "frame speed limit", str(self.frame), when
        return self.report(share, f"{words}, of {self.limit:g} m/s", reason, worst, f"speed of {self.frame!r}")

    def least_duration(self, problem: MinimumTimeProblem, q: Array, dq: Array, ddq: Array) -> float:
        return float(np.max(_speeds(problem.robot, str(self.frame), q, dq))) / self.limit


def _squares(stages: Stages, over_square: ca.SX, frame: str) -> ca.SX:
    n = stages.dynamics.nv
    q, v = ca.SX.sym("q", n), ca.SX.sym("v", n)
    velocity = ca.jtimes(stages.dynamics.frame_placement(q, frame)[1], q, v)
    square = ca.Function("square", [q, v], [ca.cse(ca.sumsqr(velocity))])
    # The first stage is the last of the interval before.
    return ca.vertcat(*(square(stages.q[:, i], stages.v[:, i]) * over_square for i in range(1, stages.c.size)))


def _speeds(robot: Robot, frame: str, q: Array, v: Array) -> Array:
    """Speed of a frame's origin [m/s], shape (samples,)."""
    model, data, fixed = robot.model, robot.model.createData(), robot.frame(frame)
    twists = []  # of the frame's joint, in the joint's axes
    for positions, velocities in zip(q, v, strict=True):
        pin.forwardKinematics(model, data, robot.configuration(positions), velocities)
        twists.append(data.v[fixed.parentJoint].vector.copy())
    linear, angular = np.hsplit(np.array(twists), 2)
    return np.asarray(np.linalg.norm(linear + np.cross(angular, fixed.placement.translation), axis=1))
