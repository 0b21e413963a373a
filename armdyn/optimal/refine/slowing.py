"""A mesh's solution keeps velocity limits at its knots; slowed down a little it keeps them between knots, too."""

from collections.abc import Iterator
from dataclasses import replace

from armdyn.optimal.landing.lead import led_home
from armdyn.optimal.landing.limits import overspeed
from armdyn.optimal.landing.pace import paced, paced_torques
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
    problem = task.problem
    if not problem.from_rest_to_rest:
        return None
    kept: list[tuple[Trajectory, Certificate]] = []
    for slowed, replay in slower(task, motion):
        certificate = certify(problem, replay, None, remark)
        if certificate.limit_violation <= LIMIT_TOLERANCE:
            kept.append((slowed, certificate))
            break
    if not kept or kept[0][1].goal_error > GOAL_TOLERANCE:
        # Open loop an unstable arm does not follow: feedback makes it.
        led, replay, _ = led_home(task, motion)
        certificate = certify(problem, replay, None, remark)
        if certificate.limit_violation <= LIMIT_TOLERANCE:
            kept.append((led, certificate))
    kept.sort(key=lambda pair: pair[1].goal_error)
    return kept[0] if kept and kept[0][1].goal_error <= task.options.replay_tolerance else None
