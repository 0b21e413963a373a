"""Slow a motion down along its path to the highest pace within all limits."""

from dataclasses import replace

import numpy as np

from armdyn.optimal.flat.curve import Curve
from armdyn.optimal.flat.follow import follow
from armdyn.optimal.flat.refinement import sampled
from armdyn.optimal.landing.limit_violations import (
    can_be_slowed,
    constraints_mended,
    excesses,
    least_factor,
    paced,
    paced_torques,
)
from armdyn.optimal.landing.rollout import dense, replay_of
from armdyn.optimal.path_constraints.tightened import ConstraintReports, TightenedConstraints
from armdyn.optimal.proof.certificate import GOAL_TOLERANCE, LIMIT_TOLERANCE, certify
from armdyn.optimal.refine.optimum import Optimum, trajectory_cost
from armdyn.optimal.task.task import Task
from armdyn.reprs import percent
from armdyn.trajectory import Trajectory


def slowed(task: Task, optimum: Optimum) -> Optimum:
    """Slow an optimum down by the smallest factor for which its replay satisfies all limits and constraints.

    Every strategy ends with this step. The optimum is returned unchanged, with its arcs, if it exceeds no limit, does
    not land, cannot be slowed down (`can_be_slowed`), or violates constraints independent of pace: position limits,
    clearances, via points.

    Args:
        task: the problem and its settings.
        optimum: a replayed and certified optimum.
    """
    numbers, factor = task.policy.refinement, least_slowing(task, optimum)
    if factor == 1 or not (np.isfinite(factor) and can_be_slowed(task.problem)):
        return optimum
    if not optimum.landed(task.options.replay_tolerance):
        return optimum
    path, whole = replay_of(task, dense(optimum.trajectory, numbers.slow_samples)), 1.0
    for _ in range(numbers.slowing):
        whole *= factor
        found = _at_pace(task, optimum, path, whole)
        factor = least_slowing(task, found)
        lost = found.certificate.goal_error > max(GOAL_TOLERANCE, optimum.certificate.goal_error + numbers.path_error)
        if factor == 1 and not lost:
            return found
        if lost or not np.isfinite(factor) or task.stop:
            break
    return optimum


def least_slowing(task: Task, optimum: Optimum) -> float:
    """Factor on the duration for which the motion satisfies all limits; 1 if it does already, inf if unknown."""
    limits, motion = task.problem.limits, optimum.trajectory
    if excesses(limits, motion)[2].share > LIMIT_TOLERANCE:
        return np.inf
    return max(optimum.reports.slowing, least_factor(task.problem.robot, limits, motion, LIMIT_TOLERANCE))


def _at_pace(task: Task, optimum: Optimum, path: Trajectory, factor: float) -> Optimum:
    """Slow an optimum down along its path by a factor, and replay it."""
    problem = task.problem
    slowed = replace(paced(path, factor), tau=paced_torques(problem.robot, path, path.tau, factor))
    motion = replace(follow(task, slowed), name=optimum.trajectory.name)
    passing = factor * np.array(optimum.via_times)
    remark = optimum.certificate.remark or f"slowed down by {percent(factor - 1)} to keep its limits: no extremal"
    certificate = replace(certify(problem, motion, None, remark), idle=optimum.certificate.idle)
    return replace(
        optimum,
        trajectory=motion,
        certificate=certificate,
        cost=trajectory_cost(motion, problem.effort_weights()),
        phases=None,
        costates=None,
        arcs=(),
        reports=TightenedConstraints.of(task).check(problem, motion, passing),
        via_times=tuple(passing.tolist()),
    )


def within_constraints(
    task: Task, curve: Curve, replay: Trajectory, constraints: TightenedConstraints
) -> tuple[Curve, Trajectory, ConstraintReports]:
    """Check the path constraints; slow the curve down where its replay exceeds them much, or Coulomb friction acts.

    Lines between samples miss the bend of the torque of Coulomb friction, which shakes light joints beyond their jerk
    limits: such a curve is sampled finer before it is slowed down. `slowed`, which slows down the replay itself, would
    end off the goal there, and where the arm is unstable.

    Args:
        task: the problem.
        curve: the motion.
        replay: of it.
        constraints: to be checked.
    """
    problem = task.problem
    reports = constraints.check(problem, replay, curve.passing)
    rubs = bool(np.any(np.asarray(problem.robot.friction.coulomb) > 0))
    finer = task.policy.curves.finer_still if rubs else ()
    needed = can_be_slowed(problem) and (rubs or not constraints_mended(task, reports))
    for k in range(len(finer) + task.policy.refinement.slowing if needed else 0):
        if reports.slowing == 1 or not np.isfinite(reports.slowing):
            break
        if k >= len(finer):
            curve = curve.slower(reports.slowing + task.policy.path_constraints.slower)
        replay = follow(task, sampled(task, curve, max(finer[: k + 1], default=1)))
        reports = constraints.check(problem, replay, curve.passing)
    return curve, replay, reports
