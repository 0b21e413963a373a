"""Time optimality of a given motion: any planner's trajectory against the minimum-time optimum."""

from __future__ import annotations

from dataclasses import dataclass, replace
from operator import attrgetter

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline

from armdyn.arguments import expect, numbers
from armdyn.arrays import Array
from armdyn.dynamics.numeric import inverse_dynamics
from armdyn.errors import TrajectoryError
from armdyn.files import attributes
from armdyn.models.presets.check import ConditionCheck, check_table
from armdyn.models.robots.loads import robots_of
from armdyn.models.robots.robot import Robot
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.problem.checks import LANDING, ROUNDING
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.verify.arc import runs_of
from armdyn.optimal.verify.certificate import LIMIT_TOLERANCE, OPEN_LOOP_GROWTH
from armdyn.optimal.verify.rollout import Segments, expect_motion_of, replay_torques
from armdyn.optimal.verify.within_limits import excesses, proven_excess
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory
from armdyn.trajectory.interpolation import KEPT
from armdyn.trajectory.planned import Planned

BUSY = 0.95
"""Part of a limit above which a torque, from the middle of its range, or a speed makes a joint active."""
_SAMPLES = 1000
"""Least number of samples of a checked motion; twice as many cells of the grid on which idleness is measured."""


@brief
@dataclass(frozen=True, eq=False)
class MotionCheck:
    """Check of a motion: can the arm execute it?

    Attributes:
        feasible: the motion keeps the torque, velocity and position limits, to `KEPT`.
        worst_violation: of a limit, relative to it (positions: to the range); None if none is exceeded.
        unresolved: a torque beyond its limit by differences that the table is too coarse to prove: its rows also fit
            torques within the limits; None if there is none.
        replay_error: distance of the replay's end from the motion's own end [rad or m]; infinite if the replay
            diverges. Large: torques and positions are inconsistent, or the samples too far apart. Of several pieces the
            worst, each from its own first state. NaN, also for the next: the arm's torques are unknown.
        growth: largest singular value of ∂(end state)/∂(start state), open loop. Beyond
            `OPEN_LOOP_GROWTH` the motion is unstable, and other integrators' replays end elsewhere. Of several
            pieces the largest.
        velocity_share: largest part of a joint's velocity limit that is used; 0 without a limit.
    """

    feasible: bool
    worst_violation: Violation | None
    unresolved: Violation | None
    replay_error: float
    growth: float
    velocity_share: float

    @property
    def unstable(self) -> str:
        """Remark that other integrators do not reproduce the replay; empty if stable."""
        unstable = f"; unstable open loop (growth {self.growth:.2g}): other integrators end elsewhere"
        return unstable if self.growth > OPEN_LOOP_GROWTH else ""

    @property
    def limits_kept(self) -> str:
        """Whether the limits are kept, in words."""
        coarse = f"; more rows would show whether {self.unresolved}" if self.unresolved else ""
        if self.worst_violation is None:
            return f"kept{', as far as the rows show' if coarse else ''}{coarse}"
        return f"{'kept to within 0.1 %' if self.feasible else 'BROKEN'}; worst: {self.worst_violation}{coarse}"

    def facts(self) -> dict[str, object]:
        """The check as JSON values; null for a replay that diverges, none of a replay without known torques."""
        violations = {"worst_violation": self.worst_violation, "unresolved": self.unresolved}
        replayed = () if np.isnan(self.replay_error) else ("replay_error", "growth")
        return attributes(self, "feasible", *replayed, "velocity_share") | {
            name: None if one is None else str(one) for name, one in violations.items()
        }


def check_motion(
    robot: Robot, trajectory: Trajectory, limits: JointLimits | None = None, a: ArrayLike | None = None
) -> MotionCheck:
    """Check whether an arm can execute a motion, without a search for a faster one.

    Args:
        robot: the arm.
        trajectory: a motion of the arm, with torques.
        limits: limits to check; None: the robot's.
        a: accelerations at its samples [rad/s² or m/s²], shape (n, nv), as a table may have them: between them the
            motion is then the quintic of ros2_control, else the cubic.

    Raises:
        TrajectoryError: the trajectory is one of another robot, or a piece's model is not known, see `robots_of`.
    """
    _check_joints(robot, trajectory)
    limits = robot.limits if limits is None else limits
    given = [trajectory.q] if "v" in trajectory.derived else [trajectory.q, trajectory.v]  # as a controller has them
    if a is not None and len(given) == 2:
        given.append(_accelerations(a, trajectory))
    at = np.append(True, ~trajectory.jumps)  # of the two samples of a jump the first is a row
    rows = check_table(limits, robot.joint_names, trajectory.t[at], [each[at] for each in given])
    torque = excesses(limits, trajectory, dense=1)[0]
    shown = proven_excess(robot, trajectory, torque)
    found = [shown.worst(robot)] if shown.share > 0 else []
    found += [_violation(robot, row) for row in rows if row.share > 1]
    violation = max(found, key=attrgetter("value"), default=None)
    parts = [replace(part, pieces=()) for part in trajectory.split()]
    replays = list(zip(robots_of(robot, trajectory), parts, strict=True)) if robot.has_dynamics else []
    return MotionCheck(
        feasible=violation is None or violation.value <= KEPT,
        worst_violation=violation,
        unresolved=torque.worst(robot) if shown.share <= KEPT < torque.share else None,
        replay_error=max((_replay_error(arm, part) for arm, part in replays), default=np.nan),
        growth=max((_growth(arm, part) for arm, part in replays), default=np.nan),
        velocity_share=max((row.share for row in rows if row.condition == "velocity"), default=0.0),
    )


def _violation(robot: Robot, row: ConditionCheck) -> Violation:
    beyond = abs(row.value) - row.limit if row.condition == "velocity" else abs(row.value - row.limit)
    slides = robot.slides[robot.joint_names.index(row.joint)]
    unit = row.unit.replace("rad", "m") if slides else row.unit
    return Violation(f"{row.condition} limit", row.joint, row.time, row.share - 1, f"{beyond:.3g} {unit}")


def _accelerations(a: ArrayLike, motion: Trajectory) -> Array:
    given = numbers(a, "a", error=TrajectoryError)
    if given.shape != motion.v.shape or not np.all(np.isfinite(given)):
        raise TrajectoryError(f"a has shape {given.shape}; expected {motion.q.shape}, as q has, and finite")
    return given


def _replay_error(robot: Robot, motion: Trajectory) -> float:
    replay = replay_torques(robot, motion)
    return float(np.max(np.abs(replay.q[-1] - motion.q[-1]))) if replay.t[-1] == motion.t[-1] else float("inf")


def _growth(robot: Robot, motion: Trajectory) -> float:
    """Open-loop growth, from one or two thousand of the samples: see `MotionCheck`."""
    few = np.append(np.arange(0, motion.t.size - 1, max(1, motion.t.size // _SAMPLES)), motion.t.size - 1)
    thin = replace(motion, t=motion.t[few], q=motion.q[few], v=motion.v[few], tau=motion.tau[few])
    return Segments.of(robot, thin, most=1).growth


@brief
@dataclass(frozen=True, eq=False)
class TimeOptimality(MotionCheck):
    """A checked motion, compared with the fastest one between the same two states.

    Has all of `MotionCheck`: `feasible`, `worst_violation`, `replay_error`, `growth`.

    Attributes:
        trajectory: the motion, its torques recomputed if it had none.
        solution: the optimum found between its end states; see its `certificate`.
        idle: per joint, the part of the time without an active limit, shape (nv,).
        idle_intervals: per joint, the idle times: (from, to) [s].
    """

    trajectory: Trajectory
    solution: Solution
    idle: Array
    idle_intervals: tuple[tuple[tuple[float, float], ...], ...]

    @property
    def duration(self) -> float:
        """Duration of the motion [s]."""
        return self.trajectory.duration

    @property
    def optimal_duration(self) -> float:
        """Duration of the optimum [s]; NaN if the solver found none."""
        return self.solution.duration if self.solution.success else float("nan")

    @property
    def ratio(self) -> float:
        """Duration over optimal duration: 1 for an optimum. Below 1 a limit is broken, or a better optimum missed."""
        return self.duration / self.optimal_duration

    @property
    def gap(self) -> float:
        """Duration minus optimal duration: the time that could be saved [s]."""
        return self.duration - self.optimal_duration

    def __str__(self) -> str:
        """The comparison in a few lines: durations, gap, limits."""
        if self.solution.success:
            optimum = f"the optimum of {self.optimal_duration:.4f} s, {self.solution.certificate.claims}"
            head = f"{self.duration:.4f} s, {self.ratio:.3f} of {optimum}"
            if self.feasible and self.ratio < 1 - LIMIT_TOLERANCE:
                head = f"{self.duration:.4f} s, faster than the fastest motion found, {self.optimal_duration:.4f} s"
        else:
            head = f"{self.duration:.4f} s; no optimum to compare with: {self.solution.message}"
        names = self.solution.problem.robot.joint_names
        idle = ", ".join(f"{name} {100 * part:.0f} %" for name, part in zip(names, self.idle, strict=True))
        return f"{head}\nlimits: {self.limits_kept}\nreplay error: {self.replay_error:.2g}{self.unstable}\nidle: {idle}"


def time_optimality(
    robot: Robot,
    trajectory: Trajectory,
    options: MinimumTimeOptions | None = None,
    *,
    reserve: ArrayLike = 0.0,
    velocity_reserve: ArrayLike = 0.0,
    acceleration_limit: ArrayLike | None = None,
    jerk_limit: ArrayLike | None = None,
    a: ArrayLike | None = None,
) -> TimeOptimality:
    """Compare a motion with the fastest one between its end states.

    Args:
        robot: the arm with its limits; `Robot.with_limits` changes them.
        trajectory: any planner's motion. If its torques are all zero they are missing, and
            recomputed from its positions and velocities.
        options: options of `solve_minimum_time`; `calm` is ignored, as the fastest motion is needed.
        reserve: part of every torque limit that both motions keep for feedback: see `MinimumTimeProblem`.
        velocity_reserve: likewise of every velocity limit.
        acceleration_limit: the planner's limit [rad/s² or m/s²], which the fastest motion keeps, too; the trajectory
            itself is not checked for it.
        jerk_limit: likewise [rad/s³ or m/s³].
        a: accelerations of the motion, see `check_motion`.

    Raises:
        TrajectoryError: the trajectory is one of another robot, or its payload changes.
        ProblemError: an end state is outside the limits, or both are the same.
        UrdfError: the arm's torques are unknown, see `Robot.expect_dynamics`.
    """
    _check_joints(robot, trajectory)
    robot.expect_dynamics()
    if len(set(map(id, robots_of(robot, trajectory)))) > 1:
        raise TrajectoryError(
            f"the payload changes along the motion of {len(trajectory.pieces)} pieces, and the fastest motion has one: "
            "compare each piece by itself (trajectory.split(), armdyn export --piece), and the robot with its load"
        )
    if not np.any(trajectory.tau):  # in true free fall inverse dynamics gives zero again
        speeds = None if "v" in trajectory.derived else trajectory.v
        trajectory = trajectory_from_path(robot, trajectory.t, trajectory.q, speeds, name=trajectory.name)
    problem = MinimumTimeProblem(
        robot, q_start=trajectory.q[0], q_goal=trajectory.q[-1], v_start=trajectory.v[0], v_goal=trajectory.v[-1],
        reserve=reserve, velocity_reserve=velocity_reserve, acceleration_limit=acceleration_limit,
        jerk_limit=jerk_limit,
    )  # fmt: skip
    check = check_motion(robot, trajectory, problem.limits, a)
    idle, intervals = _idle_times(problem.limits, trajectory)
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    return TimeOptimality(
        **vars(check),
        trajectory=trajectory,
        solution=solve_minimum_time(problem, replace(options, calm=0.0)),
        idle=idle,
        idle_intervals=intervals,
    )


def trajectory_from_path(
    robot: Robot, t: ArrayLike, q: ArrayLike, v: ArrayLike | None = None, a: ArrayLike | None = None, name: str = ""
) -> Trajectory:
    """A trajectory from a planner's samples, with torques by inverse dynamics (`rnea` and the joints' friction).

    Of an arm whose inertias are unknown the torques are zero, which stands for missing ones.
    Missing velocities are derivatives of the cubic spline (not-a-knot) through the positions. Missing accelerations are
    means over the steps around each sample, by differences: at a jump of the acceleration a spline overshoots over a
    few samples. Give `a` if the planner has it.

    Args:
        robot: the arm.
        t: times [s], shape (n,).
        q: joint positions [rad or m], shape (n, nv).
        v: joint velocities [rad/s or m/s], shape (n, nv).
        a: joint accelerations [rad/s² or m/s²], shape (n, nv).
        name: name of the trajectory.

    Raises:
        TrajectoryError: the arrays do not match each other or the robot, or two samples are a jump.
    """
    q = numbers(q, "q", "joint positions, shape (n, nv)", error=TrajectoryError)
    rest = np.zeros_like(q)
    bare = Trajectory(t, q, rest if v is None else v, rest, name=name)  # type: ignore[arg-type]  # refuses no numbers
    _check_joints(robot, bare)
    if np.min(np.diff(bare.t)) <= ROUNDING * bare.duration:
        raise TrajectoryError("two samples are a jump: positions there have no derivative; give the torques instead")
    speeds = CubicSpline(bare.t, bare.q)(bare.t, 1) if v is None else bare.v
    planned = Planned(bare.t, bare.q, None if v is None else bare.v)
    given = planned.accelerations() if a is None else _accelerations(a, bare)
    tau = inverse_dynamics(robot)(bare.q, speeds, given) if robot.has_dynamics else rest
    derived = tuple(what for what, own in (("v", v), ("tau", a)) if own is None)
    return Trajectory(
        bare.t, bare.q, speeds, tau, robot.joint_names, robot.marked(name), robot.model_hash, derived=derived
    )


def _check_joints(robot: Robot, trajectory: Trajectory) -> None:
    expect_motion_of(robot, trajectory)
    if trajectory.joint_names and trajectory.joint_names != robot.joint_names:
        raise TrajectoryError(
            f"the trajectory is of joints {', '.join(trajectory.joint_names)}; {robot.name} has, in this order, "
            f"{', '.join(robot.joint_names)}"
        )


def _idle_times(limits: JointLimits, motion: Trajectory) -> tuple[Array, tuple[tuple[tuple[float, float], ...], ...]]:
    """Per joint the idle part of the time, shape (nv,), and the idle intervals [s]."""
    edges = np.union1d(motion.t, np.linspace(motion.t[0], motion.t[-1], 2 * _SAMPLES + 1))
    edges = edges[np.append(True, np.diff(edges) > ROUNDING * motion.duration)]
    edges[-1] = motion.t[-1]
    at = motion((edges[:-1] + edges[1:]) / 2)
    lower, upper = limits.actuators.range(at.q, at.v)
    pushing = np.abs(at.tau - (upper + lower) / 2) >= BUSY * ((upper - lower) / 2)
    fast = np.abs(at.v) >= BUSY * limits.velocity
    stopped = (at.q <= limits.position_lower + LANDING) | (at.q >= limits.position_upper - LANDING)
    idle = ~(pushing | fast | stopped)
    runs = [runs_of(np.flatnonzero(mask)) for mask in idle.T]
    intervals = tuple(tuple((float(edges[run[0]]), float(edges[run[-1] + 1])) for run in each) for each in runs)
    return np.diff(edges) @ idle / motion.duration, intervals
