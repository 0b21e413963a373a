"""Slow a motion down along its path to the highest pace within all limits."""

from dataclasses import replace

import numpy as np

from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import GOAL_TOLERANCE, LIMIT_TOLERANCE, certify
from armdyn.optimal.verify.follow import follow
from armdyn.optimal.verify.limit_violations import (
    can_be_slowed,
    excesses,
    least_factor,
    paced,
    paced_torques,
)
from armdyn.optimal.verify.optimum import Optimum, trajectory_cost
from armdyn.optimal.verify.rollout import dense, replay_of
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
    if not optimum.landed:
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
