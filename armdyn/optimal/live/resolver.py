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
from armdyn.dynamics.numeric import inverse_dynamics, joint_inertia
from armdyn.errors import ProblemError
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.models.scene.obstacles import Obstacle
from armdyn.models.scene.reaching import GoalPose
from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.answer.assembly import without_motion
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.flat.basis import Basis, graded
from armdyn.optimal.flat.linear_rows import TorqueRows
from armdyn.optimal.flat.nlp_data import TorqueMargin
from armdyn.optimal.landing.limit_violations import worst_violation
from armdyn.optimal.live.improving import Distances, Guess, Improved, LimitedArm, improve
from armdyn.optimal.live.program import Ends, Places, StepProgram
from armdyn.optimal.live.stopping import LastMotion, at_rest, fallback, rest_of_last
from armdyn.optimal.problem.checks import check_every_joint_has_motor
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.proof.certificate import Certificate
from armdyn.optimal.task.policy.policy import Policy
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory

_SHORTEST = 1e-3
"""Least duration of a guess [s]."""


def direct(program: StepProgram, ends: Ends, inertia: Array) -> tuple[Array, float]:
    """Cubic polynomials from the start state to rest, in the time of the slowest joint alone.

    Each joint is a double integrator: full acceleration, velocity limit, full deceleration.

    Args:
        program: program with mesh and limits.
        ends: start state and goal.
        inertia: inertia of each joint at the start [kg m² or kg], shape (nv,).

    Returns:
        Control points and duration.
    """
    way, a = ends.goal - ends.q, program.policy.guess_torque * program.half / inertia
    turn = np.where(way < ends.v * np.abs(ends.v) / (2 * a), -1.0, 1.0)
    way, v, fastest = turn * way, turn * ends.v, program.limits.velocity
    peak = np.sqrt(np.maximum(a * way + v**2 / 2, 0))
    top = np.minimum(peak, fastest)
    cruise = np.maximum(way - (2 * top**2 - v**2) / (2 * a), 0) / fastest
    duration = float(max(np.max((2 * top - v) / a + cruise), _SHORTEST))
    r = program.mesh.basis.places[:, None]
    lead, blend = (r**3 - 2 * r**2 + r) * ends.v * duration, _blend(r)
    return ends.q + lead + blend * (ends.goal - ends.q), duration


def rest_of(mesh: Places, positions: Array, ends: Ends, duration: float) -> tuple[Array, float]:
    """The rest of a motion, bent to another goal.

    Args:
        mesh: mesh of the curve.
        positions: positions of the motion at the parts `mesh.basis.places` of the remaining time [rad or m], shape
            (basis.size, nv).
        ends: start state and goal.
        duration: remaining time [s].

    Returns:
        Control points and duration.
    """
    r = mesh.basis.places[:, None]
    correction = (1 - _blend(r)) * (ends.q - positions[0]) + _blend(r) * (ends.goal - positions[-1])
    return positions + correction, max(duration, _SHORTEST)


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
_THERE = 1e-9
"""Distance from the goal [rad or m, and per second] within which an arm is at the goal: rounding of samples."""
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
    _arm: LimitedArm | None = field(default=None, init=False, repr=False)
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
        arm = replace(self._prepared(problem), distances=Distances.of(problem, Policy.of(problem).sequential))
        ends = Ends(np.asarray(problem.q_start), np.asarray(problem.v_start), np.asarray(problem.q_goal))
        inertia = np.diag(arm.inertia(ends.q))
        if (rest := self._rest_of_last(arm, ends)) is not None:
            return _solution(problem, (Status.SOLVED, rest), arm.distances, 0, time.perf_counter() - began)
        found, draft, steps = self._improved(arm, ends, inertia, until)
        self._draft = draft if found is None else None  # the next call continues from it
        if found is not None:
            late = Status.ITERATION_LIMIT if deadline is None else Status.TIME_LIMIT
            status, motion = Status.SOLVED if found.settled else late, arm.motion(found.sampled, "live")
            self._last = LastMotion(motion, found.margins, arm.program.mesh.places, found.settled)
        else:
            left = fallback(arm, ends, inertia, self._last)
            if left is None:
                self._last = None
                return without_motion(problem, Status.FAILED, _NOTHING)
            status, motion = left
            self._last = LastMotion(motion)
        return _solution(problem, (status, motion), arm.distances, steps, time.perf_counter() - began)

    def _problem(self, q: ArrayLike, v: ArrayLike, goal: ArrayLike | str | GoalPose) -> MinimumTimeProblem:
        """The checked problem."""
        end: dict[str, Any] = {"goal_pose": goal} if isinstance(goal, GoalPose) else {"q_goal": goal}
        kept: dict[str, Any] = {own.name: getattr(self, own.name) for own in fields(self) if own.init}
        problem = MinimumTimeProblem(**kept, q_start=q, v_start=v, **end)
        check_every_joint_has_motor(self.robot, problem.limits, "a Resolver plans curves")
        return problem

    def _prepared(self, problem: MinimumTimeProblem) -> LimitedArm:
        """The arm with its program: rebuilt only if limits or the robot have changed."""
        known, acceleration = self._arm, np.full(self.robot.nv, np.inf)
        if problem.acceleration_limit is not None:
            acceleration = np.asarray(problem.acceleration_limit)
        if known is not None and _alike(known.program, problem.limits, acceleration):
            program = known.program
        else:
            numbers = Policy.of(problem).live
            mesh = Places(Basis(graded(numbers.intervals, numbers.shortest)), numbers.checks)
            program = StepProgram(mesh, problem.limits, acceleration, numbers)
            self._draft = None
        if known is None or known.program is not program or known.robot is not self.robot:
            places = [(program.mesh.basis, program.mesh.places)]
            torques = TorqueRows(self.robot, program.half, places, program.layout)
            functions = inverse_dynamics(self.robot), joint_inertia(self.robot)
            known = self._arm = LimitedArm(self.robot, program, *functions, torques)
        return known

    def _rest_of_last(self, arm: LimitedArm, ends: Ends) -> Trajectory | None:
        """Rest of the last motion if it leads to the goal, or a rest if the arm is at the goal; else None."""
        if max(np.max(np.abs(ends.q - ends.goal)), np.max(np.abs(ends.v))) <= _THERE:
            return at_rest(arm, ends.goal)
        last = self._last
        if last is None or not last.settled or np.max(np.abs(last.motion.q[-1] - ends.goal)) > _THERE:
            return None
        return rest_of_last(arm, ends, last)

    def _improved(
        self, arm: LimitedArm, ends: Ends, inertia: Array, until: float
    ) -> tuple[Improved | None, Guess, int]:
        """The best motion to the goal, the last curve, and the number of steps."""
        mesh = arm.program.mesh
        none = TorqueMargin(*np.zeros((2, mesh.places.size, ends.q.size)))
        guesses = [(*direct(arm.program, ends, inertia), none)]
        if self._last is not None:
            passed, end = self._last.passed(ends.q, ends.v), float(self._last.motion.t[-1])
            positions = self._last.motion(passed + (end - passed) * mesh.basis.places).q
            margins = self._last.margins_from(passed, mesh) or none
            guesses.append((*rest_of(mesh, positions, ends, end - passed), margins))
        if self._draft is not None:
            points, duration, margins = self._draft
            guesses.append((*rest_of(mesh, points, ends, duration), margins))
        return improve(arm, ends, guesses, until)


def _alike(program: StepProgram, limits: JointLimits, acceleration: Array) -> bool:
    """Whether a program has these limits."""
    own, other = (
        (*each.rows.values(), *each.actuators.lines, most)
        for each, most in ((program.limits, program.acceleration), (limits, acceleration))
    )
    alike = type(program.limits.actuators) is type(limits.actuators)
    return alike and all(np.array_equal(a, b) for a, b in zip(own, other, strict=True))


def _solution(
    problem: MinimumTimeProblem,
    outcome: tuple[Status, Trajectory],
    distances: Distances | None,
    steps: int,
    seconds: float,
) -> Solution:
    """The solution from a motion within all limits."""
    status, motion = outcome
    exceeded = worst_violation(problem.robot, problem.limits, motion, dense=2)
    error = np.abs(problem.goal_error_of(motion))
    certificate = Certificate(
        float(np.max(error[: problem.robot.nv])), float(np.max(error[problem.robot.nv :])),
        exceeded.value if exceeded else 0.0, exceeded=exceeded, remark=_REMARK, replay="curve",
        slides=tuple(problem.robot.slides.tolist()),
    )  # fmt: skip
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
        worst_violation=exceeded,
        clearance=None if report is None else report.clearance,
        constraint_reports=() if report is None else (report,),
        moves=reaches,
    )
