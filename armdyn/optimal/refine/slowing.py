"""A mesh's solution keeps velocity limits at its knots; slowed down a little it keeps them between knots, too."""

from dataclasses import replace

import numpy as np

from armdyn.optimal.landing.aim import led_home
from armdyn.optimal.landing.pace import paced, paced_torques
from armdyn.optimal.landing.rollout import replay_torques
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.stop import Stop
from armdyn.optimal.proof.certificate import GOAL_TOLERANCE, LIMIT_TOLERANCE, Certificate, certify, excess
from armdyn.trajectory import Trajectory

_ROUNDS = 3


def within_velocity_limits(
    problem: MinimumTimeProblem, motion: Trajectory, remark: str, tolerance: float, stop: Stop
) -> tuple[Trajectory, Certificate] | None:
    """The same path at a slightly lower speed, so that no velocity limit is exceeded anywhere.

    Args:
        problem: from rest to rest.
        motion: a mesh's solution, without arcs.
        remark: what there is to say against it already.
        tolerance: goal error [rad or m] that counts as landed.
        stop: asked where it takes several rounds.

    Returns:
        The motion and its certificate; None if it would exceed another limit, or not land, or does not begin and
        end at rest.
    """
    if not problem.from_rest_to_rest:
        return None
    given, replay = motion, replay_torques(problem.robot, motion)
    kept: list[tuple[Trajectory, Certificate]] = []
    for _ in range(_ROUNDS):
        factor = 1 + np.max(excess(problem, replay).velocity / problem.limits.velocity)
        motion = replace(paced(motion, factor), tau=paced_torques(problem.robot, motion, motion.tau, factor))
        replay = replay_torques(problem.robot, motion)
        certificate = certify(problem, replay, None, remark)
        if certificate.limit_violation <= LIMIT_TOLERANCE:
            kept.append((motion, certificate))
            break
    if not kept or kept[0][1].goal_error > GOAL_TOLERANCE:
        # Open loop an unstable arm does not follow: feedback makes it.
        motion, replay, _ = led_home(problem, given, stop)
        certificate = certify(problem, replay, None, remark)
        if certificate.limit_violation <= LIMIT_TOLERANCE:
            kept.append((motion, certificate))
    kept.sort(key=lambda pair: pair[1].goal_error)
    return kept[0] if kept and kept[0][1].goal_error <= tolerance else None
