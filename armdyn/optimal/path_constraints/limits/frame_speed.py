"""Limit of a frame's speed: ISO 10218-1 limits a tool to 0.25 m/s in manual reduced-speed mode."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import casadi as ca
import numpy as np
import pinocchio as pin

from armdyn.arguments import number, text
from armdyn.arrays import Array
from armdyn.errors import ProblemError, SpecError
from armdyn.models.robots.robot import Robot
from armdyn.optimal.path_constraints.constraint import ConstraintReport, Path
from armdyn.optimal.path_constraints.limits.rates import PartialLimit, times_within
from armdyn.optimal.path_constraints.rows import RowValues, StageRows
from armdyn.optimal.problem.checks import SLOWEST
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.program.interval import Stages
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
    def of_option(cls, values: list[float], frame: str | None) -> Self:
        """The constraint from an option's number and frame."""
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
            raise ProblemError(f"FrameSpeedLimit: {error}; the tip is {robot.tip!r}") from None
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
    first = 1 if all(stages.knots) else 0  # that stage is the last of the interval before
    return ca.vertcat(*(square(stages.q[:, i], stages.v[:, i]) * over_square for i in range(first, stages.c.size)))


def _speeds(robot: Robot, frame: str, q: Array, v: Array) -> Array:
    """Speed of a frame's origin [m/s], shape (samples,)."""
    model, data, fixed = robot.model, robot.model.createData(), robot.frame(frame)
    twists = []  # of the frame's joint, in the joint's axes
    for positions, velocities in zip(q, v, strict=True):
        pin.forwardKinematics(model, data, robot.configuration(positions), velocities)
        twists.append(data.v[fixed.parentJoint].vector.copy())
    linear, angular = np.hsplit(np.array(twists), 2)
    return np.asarray(np.linalg.norm(linear + np.cross(angular, fixed.placement.translation), axis=1))
