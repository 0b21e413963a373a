"""Limits of a frame: its speed, and the region that it keeps to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import casadi as ca
import numpy as np
import pinocchio as pin

from armdyn.arguments import expect, number, text, whole
from armdyn.arrays import Array, Flags
from armdyn.errors import ProblemError, SpecError, reraised
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.proof_of_clearance import frame_accelerations
from armdyn.models.scene.reaching import DIRECTIONS, GoalPose, deviations_of, moving_directions
from armdyn.optimal.constraints.constraint import ConstraintReport, Path
from armdyn.optimal.constraints.goal_region import region_rows, region_values
from armdyn.optimal.constraints.rate_limits import PartialLimit, times_within
from armdyn.optimal.constraints.rows import RowValues, StageRows
from armdyn.optimal.constraints.stages import Stages
from armdyn.optimal.problem.checks import SLOWEST, check_every_joint_has_motor
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.trajectory import Trajectory


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
        try:
            fixed = robot.frame(frame)
        except SpecError as error:
            raise ProblemError(f"FrameSpeedLimit: {error}") from None
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
        fixed = problem.robot.frame(str(self.frame))
        return (StageRows(_squares, (fixed.parentJoint, *fixed.placement.translation.tolist()), numbers=1),)

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        return (RowValues(-np.inf, self.part**2, np.array([self.limit**-2])),)

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

    def least_duration(self, problem: MinimumTimeProblem, path: Path) -> float:
        return float(np.max(_speeds(problem.robot, str(self.frame), path.q, path.dq))) / self.limit


def _squares(stages: Stages, over_square: ca.SX, joint: int, *offset: float) -> ca.SX:
    n = stages.dynamics.nv
    q, v = ca.SX.sym("q", n), ca.SX.sym("v", n)
    place = stages.dynamics.placements(q)[:, 4 * joint - 4 : 4 * joint]
    velocity = ca.jtimes(place[:, :3] @ ca.DM(offset) + place[:, 3], q, v)
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


_STAGES = (1, 2, 3)
"""Checked stages of a curve's interval; its first is the last of the interval before."""
_REMAINDER = 0.01
"""Part of a tolerance by which a deviation may provably change between two checks."""
_CHECKS = 100
"""Largest number of checks per sample."""
_TURN = {True: 1.0, False: 2.5}
"""Largest rotation [rad] with and without a free axis: beyond these `_SECOND` does not hold."""
_SECOND = (1.6, 2.8)
"""Bounds of second derivatives of the rotation vector: 1.6 times the angular acceleration plus 2.8 times the squared
angular velocity. Without a free axis the vector changes by J ω, with |J| = (φ/2) / sin(φ/2) <= 1.32 and |∂J/∂φ| <= 1.04
up to 2.5 rad: 1.32 |α| + 1.04 1.32 |ω|². With a free axis the vector is g(c) e × a with c = e·a = cos θ and g = θ / sin
θ; up to 1 rad g <= 1.19, |g'| <= 0.51 and |g''| <= 0.53, |a'| <= |ω|, |a''| <= |α| + |ω|²."""


@dataclass(frozen=True)
class FrameRegion(PartialLimit):
    """A frame stays in a region along a leg, or the whole motion.

    Attributes:
        region: region of the frame: free, or with a tolerance, in every direction.
        leg: number of the leg between `MinimumTimeProblem.via`, from 0; None: the whole motion.
    """

    region: GoalPose
    leg: int | None = None

    name = "frame regions"
    curves_alone = True

    def __post_init__(self) -> None:
        expect(self.region, GoalPose, "region of FrameRegion", "GoalPose(frame, placement, free=…, tolerance=…)")
        if self.leg is not None:
            whole(self.leg, "leg of FrameRegion", least=0)
        turns = self.region.deviations[3:]
        angle, most = float(np.linalg.norm(turns[np.isfinite(turns)])), _TURN[self.region.axis is not None]
        if angle > most:
            raise ProblemError(
                f"FrameRegion lets {self.region.frame!r} turn by {angle:.3g} rad, and it is proven up to {most:g} rad: "
                "give smaller tolerances, or leave rotations free"
            )

    def entry(self) -> dict[str, Any]:
        return {"region": self.region, **({} if self.leg is None else {"leg": self.leg})}

    def on(self, robot: Robot, start: Array, goal: Array) -> Self:
        """Check the frame, and fill in tolerances for all directions in which the frame can move."""
        with reraised(ProblemError, "FrameRegion", SpecError):
            moving = moving_directions(robot, self.region)
        exact = np.array(DIRECTIONS)[moving & (self.region.deviations == 0)].tolist()
        if exact:
            raise ProblemError(
                f"FrameRegion has no tolerance in {', '.join(exact)}: no motion is exact between its samples; give a "
                "tolerance such as 3.5e-4 [m] or 5e-3 [rad], or name the direction in free"
            )
        return self

    def fits(self, problem: MinimumTimeProblem) -> None:
        """Refuse a leg that the motion lacks, and start, goal and via points outside the region."""
        legs = len(problem.poses) - 1
        if self.leg is not None and self.leg >= legs:
            raise ProblemError(f"FrameRegion has leg {self.leg}; the motion has {legs}, numbered from 0")
        check_every_joint_has_motor(problem.robot, problem.limits, "path_constraints has a FrameRegion")
        first, last = (0, legs) if self.leg is None else (self.leg, self.leg + 1)
        for k in range(first, last + 1):
            if k - 1 in problem.via_regions:
                continue
            over = np.abs(deviations_of(problem.robot, self.region, problem.poses[k])) - self.region.deviations
            if np.max(over) > self.policy.region_excess:
                name = "start" if k == 0 else "goal" if k == legs else f"via[{k - 1}]"
                raise ProblemError(
                    f"the {name} is {np.max(over):.3g} {'m' if np.argmax(over) < 3 else 'rad'} outside of FrameRegion "
                    f"in {DIRECTIONS[int(np.argmax(over))]}"
                )

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Deviations at the stages of every interval, and at the leg's start."""
        every = region_rows(problem.robot, self.region, "every", self.leg, _STAGES)
        return (every, region_rows(problem.robot, self.region, "first", self.leg, (0,)))

    def values(self, problem: MinimumTimeProblem) -> tuple[RowValues, ...]:
        part = self.part * self.policy.region_part
        return tuple(region_values(problem.robot, self.region, part, count) for count in (len(_STAGES), 1))

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check the region by Pinocchio, densely enough for a proof by bounds of second derivatives."""
        marks = np.concatenate([motion.t[:1], passing, motion.t[-1:]])
        first, last = (marks[0], marks[-1]) if self.leg is None else marks[self.leg : self.leg + 2]
        limited = np.isfinite(self.region.deviations) & moving_directions(problem.robot, self.region)
        times, used, angle = _sampled_deviations(problem.robot, self.region, motion, (first, last), limited)
        k, i = np.unravel_index(np.argmax(used), used.shape)
        share, direction = float(used[k, i]), np.array(DIRECTIONS)[limited][i]
        most, unit = self.region.deviations[limited][i], "m" if not direction.startswith("r") else "rad"
        name = f"region of {self.region.frame!r}" + ("" if self.leg is None else f" on leg {self.leg}")
        words = f"{share * most:.3g} of {most:.3g} {unit} at most, in {direction} at t = {times[k]:.4g} s"
        reasons = []
        if angle > _TURN[self.region.axis is not None]:
            reasons.append(f"frame {self.region.frame!r} turns by {angle:.3g} rad, too far for a proof between samples")
        if share > 1 + self.policy.rate_tolerance:
            reasons.append(f"frame {self.region.frame!r} leaves its region: {words}")
        worst = Violation("frame region", self.region.frame, float(times[k]), share - 1) if reasons else None
        return ConstraintReport(name, words, share, tuple(reasons), worst)

    def tightened(self, problem: MinimumTimeProblem, report: ConstraintReport) -> Self:
        """Lower the tolerances by the replay's excess and a margin."""
        if not report.reasons:
            return self
        part = (1 - self.policy.region_tightening) * self.part / max(float(report.share or 1), 1.0)
        return replace(self, part=max(part, self.policy.least_region))


def _sampled_deviations(
    robot: Robot, region: GoalPose, motion: Trajectory, span: tuple[float, float], limited: Flags
) -> tuple[Array, Array, float]:
    """Deviations of a frame over the tolerances, including proven upper bounds between checks.

    Args:
        robot: the arm.
        region: region of the frame.
        motion: motion, cubic between its samples.
        span: times of start and end of the check [s].
        limited: whether a direction is limited, shape (6,).

    Returns:
        Times [s], shape (m,), bounds of the deviations around them, shape (m, limited directions), and the largest
        rotation [rad].
    """
    point, (speed, turning) = frame_accelerations(robot, motion, region.frame)
    second = np.repeat(np.column_stack([point, _SECOND[0] * turning + _SECOND[1] * speed**2]), 3, axis=1)
    t, tolerance = motion.t, region.deviations[limited]
    steps = np.flatnonzero((np.diff(t) > 0) & (t[1:] > span[0]) & (t[:-1] < span[1]))
    begin, end = np.maximum(t[steps], span[0]), np.minimum(t[steps + 1], span[1])
    beyond = second[steps][:, limited] * (end - begin)[:, None] ** 2 / 8
    counts = np.ceil(np.sqrt(np.max(beyond / tolerance, axis=1, initial=0.0) / _REMAINDER)).clip(1, _CHECKS).astype(int)
    owner = np.repeat(np.arange(steps.size), counts)
    part = np.concatenate([np.arange(count) / count for count in counts])
    times = np.append(begin[owner] + part * (end - begin)[owner], end[-1])
    owner = np.append(owner, steps.size - 1)
    found = deviations_of(robot, region, motion(times).q)
    rest = (beyond / counts[:, None] ** 2)[owner]
    rest[1:] = np.maximum(rest[1:], rest[:-1])  # a check bounds the deviation on both its sides
    angle = np.linalg.norm(found[:, 3:], axis=1) if np.any(limited[3:]) else np.zeros(times.size)
    longest = float(np.max(angle + (speed[steps] * (end - begin))[owner]))
    return times, (np.abs(found[:, limited]) + rest) / tolerance, longest
