"""The end of a motion, slid along the joint positions that reach a pose as the costates say."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from armdyn.models.scene.reaching import GoalPose, slid
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.proof.certificate import TRANSVERSALITY_TOLERANCE
from armdyn.optimal.proof.transversality import end_gradient, transversality

Array = NDArray[np.float64]

_SOLVES = 8
"""At most; RRR needs two to six."""

_FIRST, _FARTHEST = 0.02, 0.3
"""Step [rad or m]: the first one's length, and any one's at most: the switching structure is to stay the same."""

_LEAST = 1e-5
"""Step [rad or m] that is worth no solve: what it saves is of the order of its square."""


def slid_end(best: Solution, goal: GoalPose, solve: Callable[[Solution, Array], Solution | None]) -> Solution:
    """The fastest solution met on the way down the duration, with steps of Barzilai and Borwein (1988).

    Args:
        best: a solution at one of the joint positions that reach the pose. It comes back where its costates are not
            known, or say that no neighbour is faster.
        goal: the pose.
        solve: from a solution and another goal, shape (nv,), the solution there; None: the time is up.
    """
    step = _FIRST
    for _ in range(_SOLVES):
        q = best.problem.x_goal[: best.problem.robot.nv]
        missed = transversality(best.problem, goal, q, best.phases)
        if best.phases is None or missed is None or missed <= TRANSVERSALITY_TOLERANCE / 10 or step < _LEAST:
            break
        slope = end_gradient(best.problem.robot, goal, q, best.phases)
        steepest = float(np.linalg.norm(slope))
        moved = slid(best.problem.robot, goal, q, -min(step, _FARTHEST) / steepest * slope, best.problem.limits)
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
