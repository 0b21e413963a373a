"""Several joint positions that reach one goal: which is reached fastest."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armdyn.codegen.deadline import LateError
from armdyn.optimal.flat.nlp_data import CurveSpec
from armdyn.optimal.flat.solve import solve_curve
from armdyn.optimal.path_constraints.tightened import TightenedConstraints
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.stop import stopping
from armdyn.optimal.search.sliding import slid_goals
from armdyn.optimal.search.starts import spline, straight_curve
from armdyn.optimal.solve.direct import solve_on_mesh
from armdyn.optimal.task.task import Task
from armdyn.reprs import brief

Array = NDArray[np.float64]


@brief
@dataclass(frozen=True, eq=False)
class GoalTried:
    """One of the joint positions that reach a goal.

    Attributes:
        q: [rad or m], shape (nv,).
        duration: of the motion found there [s]; inf if none was.
        refined: solved in full; else by one guess on a coarse mesh, or as a coarse curve.
    """

    q: Array
    duration: float
    refined: bool = False


def screened(task: Task) -> tuple[list[MinimumTimeProblem], list[GoalTried]]:
    """One problem for each of the most promising goals, best first; and all goals with coarse durations.

    Args:
        task: its problem has several `goals`; of its time limit this takes a third at most, and its `stop` is told
            where the third was not enough.
    """
    branches: list[MinimumTimeProblem] = []
    durations: list[float] = []
    problem, numbers, whole = task.problem, task.policy.goals, task.stop
    with stopping(numbers.tried * task.options.time_limit) as stop:
        task = replace(task, stop=stop)
        goals = [*slid_goals(problem, numbers), *problem.goals]
        for i, q in enumerate(goals, start=1):
            branch = problem.variant(q_goal=q, goal_pose=None, wrap=False)
            branches.append(branch)
            if stop or branch.unheld or branch.duration_bound() > numbers.hopeless * min(durations, default=np.inf):
                durations.append(np.inf)
                continue
            task.progress(f"goal {i} of {len(goals)}")
            durations.append(_tried(task.about(branch)))
    if stop.cut_short:
        whole.cut()
    order = sorted(range(len(branches)), key=lambda i: (durations[i], i))
    order = sorted(order, key=lambda i: branches[i].unheld is not None)  # those where the arm can stay first
    tried = [GoalTried(goals[i], durations[i]) for i in order]
    held = [i for i in order if branches[i].unheld is None] or order
    return [branches[i] for i in held[: numbers.solved]], tried


def _tried(task: Task) -> float:
    """The duration of one coarse solve from the straight way [s]; inf: it did not converge, or was not begun."""
    if not task.policy.strategy.curves_alone:
        guess, intervals = spline(task.problem, []), task.meshes[0]
        attempt = solve_on_mesh(task, guess, intervals, task.coarse()[-1])
        return attempt.trajectory.duration if attempt.usable else np.inf
    with suppress(LateError):
        smooth = 0.0 if task.problem.pays_effort else task.options.smooth
        spec = CurveSpec(TightenedConstraints.of(task), smooth=smooth)
        solved = solve_curve(task, straight_curve(task, task.policy.curves.coarse), spec)
        return solved.curve.duration if solved.converged else np.inf
    return np.inf
