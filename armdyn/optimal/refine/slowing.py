"""A mesh's solution keeps velocity limits at its knots; slowed down a little it keeps them between knots, too."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from armdyn.optimal.landing.aim import aimed
from armdyn.optimal.landing.limits import overspeed
from armdyn.optimal.landing.pace import paced, paced_torques
from armdyn.optimal.landing.pieces import Pieces
from armdyn.optimal.landing.rollout import replay_of
from armdyn.optimal.proof.certificate import GOAL_TOLERANCE, LIMIT_TOLERANCE, Certificate, certify
from armdyn.optimal.task.task import Task
from armdyn.trajectory import Trajectory


def slower(task: Task, motion: Trajectory) -> Iterator[tuple[Trajectory, Trajectory]]:
    """The same path at a lower and lower speed, as what the last replay exceeds velocity limits by asks for.

    Args:
        task: of which the problem is from rest to rest.
        motion: any.

    Yields:
        Motions and their replays, a few.
    """
    problem, replay = task.problem, replay_of(task, motion)
    for _ in range(task.policy.refinement.slowing):
        if task.stop:
            return
        factor = 1 + overspeed(problem.limits, replay)
        motion = replace(paced(motion, factor), tau=paced_torques(problem.robot, motion, motion.tau, factor))
        replay = replay_of(task, motion)
        yield motion, replay


def within_velocity_limits(task: Task, motion: Trajectory, remark: str) -> tuple[Trajectory, Certificate] | None:
    """The same path at a slightly lower speed, so that no velocity limit is exceeded anywhere.

    Args:
        task: of which the problem is from rest to rest.
        motion: a mesh's solution, or one of arcs whose samples are `dense`.
        remark: what there is to say against it already.

    Returns:
        The motion and its certificate; None if it would exceed another limit, or not land, or does not begin and
        end at rest.
    """
    if not task.problem.from_rest_to_rest:
        return None
    kept: list[tuple[Trajectory, Certificate]] = []
    for motions in (slower(task, motion), _slower_and_aimed(task, motion)):
        for slowed, replay in motions:
            certificate = certify(task.problem, replay, None, remark)
            if certificate.limit_violation <= LIMIT_TOLERANCE:
                kept.append((slowed, certificate))
                break
        if kept and kept[0][1].goal_error <= GOAL_TOLERANCE:
            break
    kept.sort(key=lambda pair: pair[1].goal_error)
    return kept[0] if kept and kept[0][1].goal_error <= task.options.replay_tolerance else None


def _slower_and_aimed(task: Task, motion: Trajectory) -> Iterator[tuple[Trajectory, Trajectory]]:
    """As `slower`, with torques that are constant between knots as the motion's are, and brought onto the goal."""
    problem, limits, pieces = task.problem, task.problem.limits, Pieces.of(motion)
    if pieces is None:
        return
    middles, replay, factor = motion((pieces.t[:-1] + pieces.t[1:]) / 2), replay_of(task, motion), 1.0
    for _ in range(task.policy.refinement.slowing):
        if task.stop:
            return
        factor *= 1 + overspeed(limits, replay)
        tau = paced_torques(problem.robot, middles, pieces.tau, factor)
        held = Pieces(factor * pieces.t, np.clip(tau, limits.effort_lower, limits.effort_upper))
        slowed, replay = aimed(task, held.trajectory(paced(motion, factor), task.policy.landing.samples))
        yield slowed, replay
