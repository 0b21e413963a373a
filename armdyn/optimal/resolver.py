"""Motions from a moving state to rest, within milliseconds, from several guesses."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import expect, number
from armdyn.arrays import Array
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.scene.obstacles import Obstacle
from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.answer.solution import Solution, without_motion
from armdyn.optimal.curves.curve import CurveLeg
from armdyn.optimal.curves.layout import TorqueMargin
from armdyn.optimal.curves.live import Guess, LiveProblem, improve
from armdyn.optimal.curves.live_stopping import LastMotion, at_rest, fallback, rest_of_last
from armdyn.optimal.problem.checks import ROUNDING, check_every_joint_has_motor
from armdyn.optimal.problem.policy.policy import Policy
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.verify.certificate import certify
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

_SHORTEST = 1e-3
"""Least duration of a guess [s]."""


def direct(live: LiveProblem) -> CurveLeg:
    """Cubic polynomials from the start state to rest, in the time of the slowest joint alone.

    Each joint is a double integrator: full acceleration, velocity limit, full deceleration.
    """
    start, goal = live.problem.poses
    way, a = goal - start, live.numbers.live.guess_torque * live.half / np.diag(live.inertia(start))
    turn = np.where(way < live.v * np.abs(live.v) / (2 * a), -1.0, 1.0)
    way, v, fastest = turn * way, turn * live.v, live.problem.limits.velocity
    peak = np.sqrt(np.maximum(a * way + v**2 / 2, 0))
    top = np.minimum(peak, fastest)
    cruise = np.maximum(way - (2 * top**2 - v**2) / (2 * a), 0) / fastest
    duration = float(max(np.max((2 * top - v) / a + cruise), _SHORTEST))
    r = live.basis.places[:, None]
    lead, blend = (r**3 - 2 * r**2 + r) * live.v * duration, _blend(r)
    return CurveLeg(live.basis, start + lead + blend * (goal - start), duration)


def rest_of(live: LiveProblem, positions: Array, duration: float) -> CurveLeg:
    """The rest of a motion, bent to another goal.

    Args:
        live: the problem.
        positions: positions of the motion at the parts `basis.places` of the remaining time [rad or m], shape
            (basis.size, nv).
        duration: remaining time [s].
    """
    r, (start, goal) = live.basis.places[:, None], live.problem.poses
    correction = (1 - _blend(r)) * (start - positions[0]) + _blend(r) * (goal - positions[-1])
    return CurveLeg(live.basis, positions + correction, max(duration, _SHORTEST))


def _blend(r: Array) -> Array:
    """Smooth step from 0 to 1, with zero slope at both ends."""
    return 3 * r**2 - 2 * r**3


_WORDS = {
    Status.SOLVED: "to the goal",
    Status.TIME_LIMIT: "to the goal; the deadline came before it was the shortest",
    Status.ITERATION_LIMIT: "to the goal; it may not be the shortest",
    Status.FOLLOWED: "no motion to the goal in time: the rest of the last motion, to its own goal",
    Status.STOPPED: "no motion to the goal in time: the arm comes to rest",
}
"""Messages."""
_NOTHING = "no motion to the goal in time, and no stop that was tried satisfies all limits"
_REMARK = "a live motion: neither a lower bound nor Pontryagin's conditions are checked"


@brief
@dataclass(eq=False)
class Resolver:
    """Fast motions from a moving state to rest at a goal, each starting from the last one.

    Memory and the last motion are kept between calls; another goal needs no rebuild. All attributes may be set at any
    time: another payload (`resolver.robot = robot.with_payload(…)`), other limits or obstacles hold from the next call
    on. Limits of jerk, of torque rates and of frames are ignored: use `solve_minimum_time` for these. For one thread.

    Attributes:
        robot: the arm; every joint must have a motor.
        effort_limit: torque limits [N m or N], see `MinimumTimeProblem`, also for all that follow.
        velocity_limit: velocity limits [rad/s or m/s].
        position_limit: position limits (lower, upper) [rad or m].
        reserve: part of the torque limits that is kept for feedback [-].
        velocity_reserve: part of the velocity limits, likewise [-].
        acceleration_limit: acceleration limits [rad/s² or m/s²].
        obstacles: bodies that the arm must not touch. No path round them is planned: if the straight one collides, call
            `begin_with` with a motion of `solve_minimum_time`.
        self_collision: whether pairs of links keep the clearance, too.
        clearance: least distance of bodies [m].
        allowed_contacts: pairs of names that may touch.
    """

    robot: Robot
    _: KW_ONLY
    effort_limit: ArrayLike | tuple[ArrayLike, ArrayLike] | None = None
    velocity_limit: ArrayLike | None = None
    position_limit: tuple[ArrayLike, ArrayLike] | None = None
    reserve: ArrayLike = 0.0
    velocity_reserve: ArrayLike = 0.0
    acceleration_limit: ArrayLike | None = None
    obstacles: Sequence[Obstacle] = ()
    self_collision: bool = False
    clearance: float = 0.005
    allowed_contacts: Sequence[tuple[str, str]] = ()
    _last: LastMotion | None = field(default=None, init=False, repr=False)
    _known: LiveProblem | None = field(default=None, init=False, repr=False)
    _draft: Guess | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        expect_robot(self.robot)

    def begin_with(self, solution: Solution) -> None:
        """Set the last motion: the arm is about to follow it.

        Args:
            solution: a solution, such as from `solve_minimum_time`.

        Raises:
            ProblemError: the solution is not usable, or of another robot.
        """
        motion = expect(solution, Solution, "solution").trajectory
        if not solution.usable or motion.model_hash != self.robot.model_hash:
            raise ProblemError(
                f"solution is {'usable' if solution.usable else 'not usable'} and of {solution.problem.robot.name!r}; "
                f"expected a usable motion of this {self.robot.name!r}"
            )
        self._last = LastMotion(motion)

    def solve(
        self, q: ArrayLike, v: ArrayLike, goal: ArrayLike | str | GoalPose, deadline: float | None = None
    ) -> Solution:
        """Find a fast motion from a state to rest at a goal.

        A returned motion satisfies all limits at its samples and between them. A motion to the goal ends exactly there.
        Torques are those of inverse dynamics at the samples. No bound is proven: `lower_bound` is None.

        Args:
            q: joint positions at the start of the motion [rad or m], shape (nv,): those at the time of the answer.
            v: joint velocities at the start [rad/s or m/s], shape (nv,).
            goal: joint positions [rad or m], shape (nv,), the name of a pose, or the pose of a frame.
            deadline: time limit of the answer [s]; None: no limit. A step takes some milliseconds; none is begun that
                would likely end later.

        Returns:
            A `Solution`, `usable` if it reaches the goal. Its `status` is "solved"; or "time_limit" or
            "iteration_limit" if it may not be the shortest. If no motion to the goal within all limits was found,
            "followed", the rest of the last motion, if the state is on it; or "stopped", the arm brakes or stays at
            rest; or "failed": no stop that was tried satisfies all limits, and there is no motion.

        Raises:
            ProblemError: the state is outside the limits, or rests at the goal; or see `MinimumTimeProblem`.
            ContactError: the state or the goal is in contact.
        """
        began = time.perf_counter()
        until = np.inf if deadline is None else began + number(deadline, "deadline", unit="s", sign="positive")
        problem = self._problem(q, v, goal)
        live = self._prepared(problem)
        if (rest := self._rest_of_last(live)) is not None:
            return _solution(live, (Status.SOLVED, rest), 0, time.perf_counter() - began)
        found, ended, steps = improve(live, self._guesses(live), until)
        self._draft = (found.leg, found.margins) if found.sampled is None else None  # the next call continues from it
        if found.sampled is not None:
            late = Status.ITERATION_LIMIT if deadline is None else Status.TIME_LIMIT
            solved = ended is Status.SOLVED
            status, motion = Status.SOLVED if solved else late, live.motion_of(found.sampled, "live")
            self._last = LastMotion(motion, solved)
        else:
            left = fallback(live, self._last)
            if left is None:
                self._last = None
                return without_motion(problem, Status.FAILED, _NOTHING)
            status, motion = left
            self._last = LastMotion(motion)
        return _solution(live, (status, motion), steps, time.perf_counter() - began)

    def _problem(self, q: ArrayLike, v: ArrayLike, goal: ArrayLike | str | GoalPose) -> MinimumTimeProblem:
        """The checked problem."""
        end: dict[str, Any] = {"goal_pose": goal} if isinstance(goal, GoalPose) else {"q_goal": goal}
        kept: dict[str, Any] = {own.name: getattr(self, own.name) for own in fields(self) if own.init}
        problem = MinimumTimeProblem(**kept, q_start=q, v_start=v, **end)
        check_every_joint_has_motor(self.robot, problem.limits, "a Resolver plans curves")
        return problem

    def _prepared(self, problem: MinimumTimeProblem) -> LiveProblem:
        """The problem with its program: rebuilt only if limits or the robot have changed."""
        known = self._known
        if known is None or not _alike(known.problem, problem):
            known, self._draft = LiveProblem.of(problem, Policy.of(problem)), None
        self._known = known.for_problem(problem)
        return self._known

    def _rest_of_last(self, live: LiveProblem) -> Trajectory | None:
        """Rest of the last motion if it leads to the goal, or a rest if the arm is at the goal; else None."""
        start, goal = live.problem.poses
        if max(np.max(np.abs(start - goal)), np.max(np.abs(live.v))) <= ROUNDING:
            return at_rest(live, goal)
        last = self._last
        if last is None or not last.settled or np.max(np.abs(last.motion.q[-1] - goal)) > ROUNDING:
            return None
        return rest_of_last(live, last)

    def _guesses(self, live: LiveProblem) -> list[Guess]:
        """Initial curves: a direct one, the rest of the last motion, and unfinished work."""
        basis, start = live.basis, live.problem.poses[0]
        guesses = [(direct(live), TorqueMargin())]
        if self._last is not None:
            passed, end = self._last.passed(start, live.v), float(self._last.motion.t[-1])
            positions = self._last.motion(passed + (end - passed) * basis.places).q
            guesses.append((rest_of(live, positions, end - passed), TorqueMargin()))
        if self._draft is not None:
            leg, margins = self._draft
            guesses.append((rest_of(live, leg.points, leg.duration), margins))
        return guesses


def _alike(problem: MinimumTimeProblem, other: MinimumTimeProblem) -> bool:
    """Whether two problems have the same limits."""
    own, given = (
        (*each.limits.rows.values(), *each.limits.actuators.lines, each.rates[0]) for each in (problem, other)
    )
    alike = type(problem.limits.actuators) is type(other.limits.actuators)
    return alike and all(np.array_equal(a, b) for a, b in zip(own, given, strict=True))


def _solution(live: LiveProblem, outcome: tuple[Status, Trajectory], steps: int, seconds: float) -> Solution:
    """The solution from a motion within all limits."""
    problem, distances = live.problem, live.distances
    status, motion = outcome
    certificate = replace(certify(problem, motion, None, _REMARK, dense=2), replay="curve")
    reaches = status not in (Status.FOLLOWED, Status.STOPPED)
    report = None if distances is None else distances.report
    return Solution(
        success=reaches and certificate.usable,
        status=status,
        message=f"{motion.duration:.6g} s, {_WORDS[status]}",
        problem=problem,
        duration=motion.duration,
        trajectory=motion,
        certificate=certificate,
        iterations=steps,
        solve_time=seconds,
        worst_violation=certificate.exceeded,
        clearance=None if report is None else report.clearance,
        constraint_reports=() if report is None else (report,),
        moves=reaches,
    )
