"""Refined and replayed optimum, its margins within the limits, and its slowing down to them."""

from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from armdyn.models.values.joint_limits import JointLimits
from armdyn.optimal.constraints.constraint import ConstraintReports
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.problem.checks import ROUNDING
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Violation
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.arc import Arc
from armdyn.optimal.verify.certificate import (
    GOAL_TOLERANCE,
    LIMIT_TOLERANCE,
    SEGMENT_TOLERANCE,
    Certificate,
    certify,
    repeated,
)
from armdyn.optimal.verify.costates import Costates, Phases, Share, adjoint_error
from armdyn.optimal.verify.rollout import dense, replay_of
from armdyn.optimal.verify.within_limits import can_be_slowed, excesses, follow, least_factor, paced, paced_torques
from armdyn.reprs import percent
from armdyn.trajectory import Trajectory


@dataclass(frozen=True, eq=False)
class Optimum:
    """A motion with its replay, certificate and cost.

    Attributes:
        trajectory: replay: states and torques are consistent to the integrator's tolerance.
        certificate: certificate of the motion.
        cost: objective J [s].
        intervals: number of intervals of its mesh.
        phases: solved arcs; None: not resolved, with the reason in the certificate.
        costates: costates of an extremal; None: unknown.
        arcs: arcs, solved or read from a resolved mesh; empty: neither.
        iterations: iterations of IPOPT.
        worst_violation: worst violation of the mesh's solution, if it did not converge.
        reports: reports on the path constraints.
        via_times: times of the via points [s].
        decides: share of the time that each limit decides, largest first; for motions without arcs.
        calm: time spent on calm joints [s].
    """

    trajectory: Trajectory
    certificate: Certificate
    cost: float
    intervals: int
    phases: Phases | None = None
    costates: Costates | None = None
    arcs: tuple[Arc, ...] = ()
    iterations: int = 0
    worst_violation: Violation | None = None
    reports: ConstraintReports = field(default_factory=ConstraintReports)
    via_times: tuple[float, ...] = ()
    decides: tuple[Share, ...] = ()
    calm: float = 0.0

    @classmethod
    def of(
        cls,
        problem: MinimumTimeProblem,
        replay: Trajectory,
        intervals: int,
        phases: Phases | None = None,
        remark: str = "",
        idle: tuple[str, ...] | None = None,
        **more: Any,
    ) -> Self:
        """Make an optimum from a replay, with its certificate and its cost J.

        Args:
            problem: the minimum-time problem.
            replay: replay: its states follow from its torques.
            intervals: number of intervals of its mesh.
            phases: solved arcs; None: not resolved.
            remark: reason for missing arcs.
            idle: idle joints; None: those that the costates show.
            more: other attributes.
        """
        motion = replace(replay, name="minimum time")
        certificate = certify(problem, motion, phases, remark)
        certificate = certificate if idle is None else replace(certificate, idle=idle)
        found: dict[str, Any] = {"costates": phases, "arcs": phases.arcs} if phases else {}
        cost = motion.duration + effort_cost(problem, motion)
        return cls(motion, certificate, cost, intervals, phases, **(found | more))

    @property
    def missed(self) -> tuple[str, ...]:
        """Violated path constraints, in words."""
        return self.reports.reasons

    @property
    def usable(self) -> bool:
        """Whether the replay reaches the goal within all limits and path constraints."""
        return self.certificate.usable and not self.missed


def as_replayed(task: Task, optimum: Optimum) -> Optimum:
    """Complete an optimum's certificate: `repeated`, and of an extremal on exact arcs the adjoint equations' error.

    States that do not repeat give way to those of a replay.

    Args:
        task: the problem and its settings.
        optimum: a landed optimum.
    """
    motion, certificate = optimum.trajectory, optimum.certificate
    if certificate.growth is None:  # else it was repeated by its refinement method
        certificate = repeated(task.problem, motion, certificate)
    if not certificate.repeats and (replay := replay_of(task, motion)).t[-1] == motion.t[-1]:
        motion = replace(replay, name=motion.name)
        certificate = repeated(task.problem, motion, optimum.certificate)
    if optimum.phases is not None and certificate.adjoint_error is None and certificate.extremal:
        error = adjoint_error(task.problem.robot, motion, optimum.phases)
        certificate = replace(certificate, adjoint_error=error)
    return replace(optimum, trajectory=motion, certificate=certificate)


def trajectory_cost(motion: Trajectory, weight: ArrayLike) -> float:
    """J = ∫ (1 + ½ Σ wᵢ τᵢ²) dt [s], see `torque_squared`; w in 1/(N m)²."""
    return motion.duration + torque_squared(motion, weight) / 2


def effort_cost(problem: MinimumTimeProblem, motion: Trajectory) -> float:
    """Part of J that torques cost, ½ ∫ Σ wᵢ τᵢ² dt [s]."""
    return torque_squared(motion, problem.effort_weights()) / 2 if problem.pays_effort else 0.0


def torque_squared(motion: Trajectory, weight: ArrayLike = 1.0) -> float:
    """∫ Σ wᵢ τᵢ² dt [(N m)² s times w's unit], exact for linear and held torques.

    Args:
        motion: motion with times and torques.
        weight: w, one number or one per joint.
    """
    a, b = motion.tau[:-1], motion.tau_end
    squares = np.sum(np.asarray(weight) * (a * a + a * b + b * b), axis=1) / 3
    return float(np.diff(motion.t) @ squares)


@dataclass(frozen=True)
class MeshMargins:
    """Margins by which a mesh's motion stays within its limits, for excesses between knots and for feedback.

    Attributes:
        velocity: margin of velocities, as a part of the limits.
        position: margin of positions, as a part of the joints' ranges.
        torque: margin of torques, as a part of the limits.
    """

    velocity: float = 0.0
    position: float = 0.0
    torque: float = 0.0

    def task_within(self, task: Task) -> Task:
        """The task with limits reduced by the margins, as far as both ends allow."""
        problem, limits, reserves = task.problem, task.problem.limits, task.problem.reserves
        weak = np.where(limits.actuators.lower * limits.actuators.upper < 0, self.torque, 0.0)
        fastest = np.max(np.abs([problem.x_start, problem.x_goal]), axis=0)[problem.robot.nv :]
        spare = np.clip(1 - (1 + ROUNDING) * fastest / limits.velocity, 0.0, 1.0)
        whole = limits.position_upper - limits.position_lower
        room = self.position * np.where(np.isfinite(whole), whole, 1.0)  # 1 rad, as in `excesses`
        lower, upper = limits.position_lower + room, limits.position_upper - room
        within = problem.variant(
            velocity_reserve=reserves.velocity + (1 - reserves.velocity) * np.minimum(self.velocity, spare),
            reserve=reserves.effort + (1 - reserves.effort) * weak,
            position_limit=(
                np.where(np.all(problem.poses > lower, axis=0), lower, limits.position_lower),
                np.where(np.all(problem.poses < upper, axis=0), upper, limits.position_upper),
            ),
        )
        return replace(task, problem=within)

    def wider(self, task: Task, optimum: Optimum, torque: float = 0.0) -> Self:
        """Margins wider by an optimum's excesses.

        Args:
            task: the problem and its settings.
            optimum: motion of a mesh with these margins.
            torque: the new margin of torques, as a part of the limits.
        """
        velocity, position = excess(task.problem.limits, optimum.trajectory)
        return type(self)(self.velocity + velocity, self.position + position, torque)


def excess(limits: JointLimits, motion: Trajectory) -> tuple[float, float]:
    """Excess over limits of velocity and of position, as parts of these; 0 for positions within tolerance."""
    _, velocity, position = (one.share for one in excesses(limits, motion))
    return velocity, position if position > LIMIT_TOLERANCE else 0.0


def slowed(task: Task, optimum: Optimum) -> Optimum:
    """Slow an optimum down by the smallest factor for which its replay satisfies all limits and constraints.

    Every strategy ends with this step. The optimum is returned unchanged, with its arcs, if it exceeds no limit, does
    not land, cannot be slowed down (`can_be_slowed`), or violates constraints independent of pace: position limits,
    clearances, via points.

    Args:
        task: the problem and its settings.
        optimum: a replayed and certified optimum.
    """
    numbers, factor = task.policy.path_constraints, least_slowing(task.problem, optimum)
    if factor == 1 or not (np.isfinite(factor) and can_be_slowed(task.problem)):
        return optimum
    if not optimum.certificate.lands:
        return optimum
    path, whole = replay_of(task, dense(optimum.trajectory, numbers.slow_samples)), 1.0
    for _ in range(numbers.rounds):
        whole *= factor
        found = _at_pace(task, optimum, path, whole)
        factor = least_slowing(task.problem, found)
        away = optimum.certificate.goal_error + SEGMENT_TOLERANCE  # from the path's end
        lost = found.certificate.goal_error > max(GOAL_TOLERANCE, away)
        if factor == 1 and not lost:
            return found
        if lost or not np.isfinite(factor) or task.stop:
            break
    return optimum


def least_slowing(problem: MinimumTimeProblem, optimum: Optimum) -> float:
    """Factor on the duration for which the motion satisfies all limits; 1 if it does already, inf if unknown."""
    limits, motion = problem.limits, optimum.trajectory
    if excesses(limits, motion)[2].share > LIMIT_TOLERANCE:
        return np.inf
    return max(optimum.reports.slowing, least_factor(problem.robot, limits, motion, LIMIT_TOLERANCE))


def _at_pace(task: Task, optimum: Optimum, path: Trajectory, factor: float) -> Optimum:
    """Slow an optimum down along its path by a factor, and replay it."""
    problem = task.problem
    slowed = replace(paced(path, factor), tau=paced_torques(problem.robot, path, path.tau, factor))
    motion = follow(task, slowed)
    passing = factor * np.array(optimum.via_times)
    remark = optimum.certificate.remark or f"slowed down by {percent(factor - 1)} to keep its limits: no extremal"
    reports = TightenedConstraints.of(task).check(problem, motion, passing)
    idle, times = optimum.certificate.idle, tuple(passing.tolist())
    made = Optimum.of(problem, motion, optimum.intervals, None, remark, idle, reports=reports, via_times=times)
    return replace(made, iterations=optimum.iterations, decides=optimum.decides, calm=optimum.calm)
