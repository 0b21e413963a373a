"""Regions of a frame: the goal's, those of via points, and those that it stays in.

The mesh is distributed over the legs between via points, whose end knots have equal bounds (`legs`), so that poses need
no rows; the replay's misses are corrected by offsets. Where legs meet in a region, curves share a free control point.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, Self

import casadi as ca
import numpy as np

from armdyn.arguments import expect, whole
from armdyn.arrays import Array, Flags
from armdyn.errors import ProblemError, SpecError, reraised
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.proof_of_clearance import frame_accelerations
from armdyn.models.scene.reaching import DIRECTIONS, GoalPose, deviations_of, moving_directions
from armdyn.optimal.constraints.constraint import ConstraintReport, PartialLimit, PathConstraint
from armdyn.optimal.constraints.rows import StageRows, Stages, Where
from armdyn.optimal.problem.checks import check_every_joint_has_motor
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.reprs import joint_unit
from armdyn.trajectory import Trajectory

_LEAST = 1e-2
"""Least scale of deviations [m or rad], which prices the program's violations: a tip travels this far in 10 ms."""
_CHECKS = 100
"""Largest number of checks per sample of a replay, or in the search for the passage of a region."""
_REMAINDER = 1 / _CHECKS
"""Part of a tolerance by which a deviation may provably change between two checks: of a deviation that crosses its
tolerance within a sample, that between as many checks as there may be."""
_STAGES = (1, 2, 3)
"""Checked stages of a curve's interval; its first is the last of the interval before."""
_TURN = {True: 1.0, False: 2.5}
"""Largest rotation [rad] with and without a free axis: beyond these `_SECOND` does not hold."""
_SECOND = (1.6, 2.8)
"""Bounds of second derivatives of the rotation vector: 1.6 times the angular acceleration plus 2.8 times the squared
angular velocity. Without a free axis the vector changes by J ω, with |J| = (φ/2) / sin(φ/2) <= 1.32 and |∂J/∂φ| <= 1.04
up to 2.5 rad: 1.32 |α| + 1.04 1.32 |ω|². With a free axis the vector is g(c) e × a with c = e·a = cos θ and g = θ / sin
θ; up to 1 rad g <= 1.19, |g'| <= 0.51 and |g''| <= 0.53, |a'| <= |ω|, |a''| <= |α| + |ω|²."""


@dataclass(frozen=True)
class GoalRegion(PathConstraint):
    """The last joint positions bring a frame into the region of a goal pose.

    Attributes:
        goal: the region.
    """

    goal: GoalPose

    name = "goal region"

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows of the last interval."""
        return (region_rows(problem.robot, self.goal, "last"),)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: np.ndarray) -> ConstraintReport:
        """Report without a check: the end found becomes the goal, which is checked separately."""
        return ConstraintReport(self.name, "the end is chosen within the region")


def region_rows(
    robot: Robot,
    goal: GoalPose,
    where: Where,
    leg: int | None = None,
    stages: tuple[int, ...] = (-1,),
    part: float = 1.0,
) -> StageRows:
    """Rows of a frame's deviations from a goal, within a part of the tolerances in both directions.

    Args:
        robot: the arm.
        goal: the region.
        where: intervals with rows.
        leg: index of the leg; None: the whole motion.
        stages: indices of the interval's stages.
        part: part of the tolerances.
    """
    limited = np.flatnonzero(np.isfinite(goal.deviations) & moving_directions(robot, goal))
    most, pose = goal.deviations[limited], goal.pose
    scale = np.maximum(most, _LEAST)
    bound = np.tile(part * most / scale, len(stages))
    numbers = np.concatenate([pose.rotation.ravel(order="F"), pose.translation, 1 / scale])
    arguments = (goal.frame, tuple(limited.tolist()), goal.axis, stages)
    return StageRows(_deviations, -bound, bound, numbers, arguments, where, leg)


def _deviations(
    stages: Stages, numbers: ca.SX, frame: str, limited: tuple[int, ...], axis: int | None, at: tuple[int, ...]
) -> ca.SX:
    """Deviations from a goal at stages of an interval, as in `GoalPose`, over scales.

    Args:
        stages: stages of the interval.
        numbers: rotation, column by column, and position of the goal, one over the scales, shape (12 + rows,).
        frame: name of the frame.
        limited: directions with rows, in order.
        axis: index of the axis about which the frame may turn.
        at: indices of the stages.
    """
    n = stages.dynamics.nv
    q, pose = ca.SX.sym("q", n), ca.SX.sym("pose", 12)
    back = ca.reshape(pose[:9], 3, 3).T
    rotation, origin = stages.dynamics.frame_placement(q, frame)
    turned = back @ rotation
    if axis is None:
        across = ca.vertcat(*(turned[k, j] - turned[j, k] for j, k in ((1, 2), (2, 0), (0, 1)))) / 2
        cosine = (ca.trace(turned) - 1) / 2
    else:
        across, cosine = ca.cross(ca.DM.eye(3)[:, axis], turned[:, axis]), turned[axis, axis]
    sine = ca.sqrt(ca.sumsqr(across) + 1e-20)  # differentiable at zero deviation
    deviations = ca.vertcat(back @ (origin - pose[9:]), across * ca.atan2(sine, cosine) / sine)
    one = ca.Function("deviations", [q, pose], [ca.vertcat(*(deviations[k] for k in limited))])
    return ca.vertcat(*(one(stages.q[:, k], numbers[:12]) * numbers[12:] for k in at))


@dataclass(frozen=True)
class ViaPoints(PathConstraint):
    """The motion passes through `problem.via`.

    Attributes:
        parts: parts of the regions' tolerances in the program; empty: the whole tolerances.
    """

    parts: tuple[float, ...] = field(default=(), kw_only=True)

    name = "via points"

    @classmethod
    def from_problem(cls, problem: MinimumTimeProblem) -> Self | None:
        return cls() if problem.via else None

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Rows at the ends of legs in regions."""
        parts, regions = self.parts or np.ones(len(problem.via)), problem.via_regions.items()
        return tuple(region_rows(problem.robot, one, "last", leg, part=parts[leg]) for leg, one in regions)

    def check(self, problem: MinimumTimeProblem, motion: Trajectory, passing: Array) -> ConstraintReport:
        """Check the distance from each via point: of a pose at its time, of a region at the nearest time."""
        reasons, worst, errors = list[str](), list[Violation](), []
        for i, (via, time) in enumerate(zip(problem.via, passing, strict=True)):
            if isinstance(via, GoalPose):
                error, time, which = _nearest_deviation(problem, motion, via, float(time))
                enough, unit = self.policy.tolerance, "rad" if which.startswith("r") else "m"
                miss = f"{error:.2g} {unit} outside the region of via[{i}], in {which}"
            else:
                distance = np.abs(motion(time).q - np.asarray(via))
                error, which = float(np.max(distance)), problem.robot.joint_names[int(np.argmax(distance))]
                miss = f"{error:.2g} {joint_unit(problem.robot.slides)} off via point {i}"
                enough = self.policy.near
            errors.append(error)
            if error > enough:
                reasons.append(f"it passes {miss}")
                worst.append(Violation(f"via point {i}", which, float(time), error))
        times = ", ".join(f"{t:.4f}" for t in passing)
        words = f"at {times} s, within {max(max(errors), 0.0):.1e} rad" + (" or m" if problem.via_regions else "")
        most = max(worst, key=lambda one: one.value, default=None)
        return ConstraintReport(self.name, words, None, tuple(reasons), most, np.array(errors))

    def tightened(self, problem: MinimumTimeProblem, report: ConstraintReport) -> Self:
        """Lower a region's tolerance if the replay passed outside."""
        parts = list(self.parts or np.ones(len(problem.via)))
        for i, region in problem.via_regions.items():
            given = region.deviations[(region.deviations > 0) & np.isfinite(region.deviations)]
            if report.missed[i] > self.policy.tolerance and given.size:
                parts[i] = max(parts[i] - 2 * float(report.missed[i]) / float(np.min(given)), 0.0)
        return replace(self, parts=tuple(parts))


def _nearest_deviation(
    problem: MinimumTimeProblem, motion: Trajectory, region: GoalPose, passing: float
) -> tuple[float, float, str]:
    """Smallest deviation of a motion from a region [m or rad], its time [s], and its direction.

    The time is the one around the planned time with the least deviations over the tolerances.
    """
    k = int(np.clip(np.searchsorted(motion.t, passing), 1, motion.t.size - 1))
    step = motion.t[k] - motion.t[k - 1]
    most = region.deviations
    time, scale = passing, np.where((most > 0) & np.isfinite(most), most, 1e-3)
    for width in (step, 2 * step / _CHECKS):
        times = np.clip(time + width * np.linspace(-1, 1, _CHECKS + 1), motion.t[0], motion.t[-1])
        over = np.abs(deviations_of(problem.robot, region, motion(times).q)) - most
        best = int(np.argmin(np.max(over / scale, axis=1)))
        time = float(times[best])
    which = int(np.argmax(over[best]))
    return float(over[best, which]), time, DIRECTIONS[which]


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
        """Check the frame, and refuse directions in which it can move without a tolerance, and a region without any."""
        with reraised(ProblemError, "FrameRegion", SpecError):
            moving = moving_directions(robot, self.region)
        exact = np.array(DIRECTIONS)[moving & (self.region.deviations == 0)].tolist()
        if exact:
            raise ProblemError(
                f"FrameRegion has no tolerance in {', '.join(exact)}: no motion is exact between its samples; give a "
                "tolerance such as 3.5e-4 [m] or 5e-3 [rad], or name the direction in free"
            )
        if not np.any(moving & np.isfinite(self.region.deviations)):
            raise ProblemError(
                f"FrameRegion limits no direction in which {self.region.frame!r} can move, which are "
                f"{', '.join(np.array(DIRECTIONS)[moving].tolist())}: give one of them a tolerance"
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
            if np.max(over) > self.policy.tolerance:
                name = "start" if k == 0 else "goal" if k == legs else f"via[{k - 1}]"
                raise ProblemError(
                    f"the {name} is {np.max(over):.3g} {'m' if np.argmax(over) < 3 else 'rad'} outside of FrameRegion "
                    f"in {DIRECTIONS[int(np.argmax(over))]}"
                )

    def rows(self, problem: MinimumTimeProblem) -> tuple[StageRows, ...]:
        """Deviations at the stages of every interval, and at the leg's start."""
        part = self.part * self.policy.region_part
        every = region_rows(problem.robot, self.region, "every", self.leg, _STAGES, part)
        return (every, region_rows(problem.robot, self.region, "first", self.leg, (0,), part))

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
        if share > 1 + self.policy.tolerance:
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
