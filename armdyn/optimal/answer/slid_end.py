"""The end of a motion, slid along the joint positions that reach a pose as the costates say."""

from collections.abc import Callable

import numpy as np

from armdyn.arrays import Array
from armdyn.models.scene.reaching import GoalPose, slid
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.proof.certificate import TRANSVERSALITY_TOLERANCE
from armdyn.optimal.proof.transversality import end_gradient, transversality
from armdyn.optimal.task.policy.search import GoalPolicy


def slid_end(
    best: Solution, goal: GoalPose, numbers: GoalPolicy, solve: Callable[[Solution, Array], Solution | None]
) -> Solution:
    """The fastest solution met on the way down the duration, with steps of Barzilai and Borwein (1988).

    Args:
        best: a solution at one of the joint positions that reach the pose. It comes back where its costates are not
            known, or say that no neighbour is faster.
        goal: the pose.
        numbers: of the policy.
        solve: from a solution and another goal, shape (nv,), the solution there; None: the time is up.
    """
    step = numbers.end_first
    for _ in range(numbers.end_solves):
        q = best.problem.x_goal[: best.problem.robot.nv]
        missed = transversality(best.problem, goal, q, best.phases)
        if (
            best.phases is None
            or missed is None
            or missed == np.inf
            or missed <= TRANSVERSALITY_TOLERANCE / 10
            or step < numbers.end_least
        ):
            break
        slope = end_gradient(best.problem.robot, goal, q, best.phases)
        steepest = float(np.linalg.norm(slope))
        by = -min(step, numbers.end_farthest) / steepest * slope
        moved = slid(best.problem.robot, goal, q, by, best.problem.limits)
        other = None if moved is None else solve(best, moved)
        if moved is None or other is None:
            break
        if not other.success or other.phases is None or other.duration >= best.duration:
            step /= 4
            continue
        turned = end_gradient(best.problem.robot, goal, moved, other.phases)
        away, bent = moved - q, float((moved - q) @ (turned - slope))
        step = float(away @ away) / bent * float(np.linalg.norm(turned)) if bent > 0 else 2 * step
        best = other
    return best
