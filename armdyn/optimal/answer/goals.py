"""Problems with several goals, such as the joint positions that reach a goal pose: the fastest of their solutions."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.arrays import Array
from armdyn.models.scene.reaching import GoalPose, slid
from armdyn.optimal.answer.assembly import ended_in_time, with_certificate
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.bound.lower_bound import least_duration
from armdyn.optimal.curves.goals import GoalResult, screened
from armdyn.optimal.problem.policy.search import GoalPolicy
from armdyn.optimal.problem.status import Status, Stop, stopping
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.certificate import GAP_TOLERANCE
from armdyn.optimal.verify.sensitivity import end_gradient, transversality

Solve = Callable[[Task, float], Solution]


def fastest_goal(task: Task, solve: Solve) -> Solution:
    """Solve for the most promising goals of a problem; return the best solution, with the goals of all.

    Args:
        task: of a problem with several goals, or a goal pose.
        solve: solves a task with one goal within a time limit [s].
    """
    started, problem, options, numbers = time.perf_counter(), task.problem, task.options, task.policy.goals
    until = started + options.time_limit
    task = replace(task, stop=Stop(until, within=task.stop))
    tasks, tried = screened(task)
    solutions: list[Solution] = []
    for i, branch in enumerate(tasks):
        if solutions and task.stop:
            break
        task.progress(f"goal {i + 1} of the {len(tasks)} best")
        solutions.append(solve(branch, max(until - time.perf_counter(), 1e-3)))
        found = solutions[-1].duration if solutions[-1].success else np.inf
        tried[i] = GoalResult(np.asarray(branch.problem.q_goal), found, refined=True)
    best = min(solutions, key=lambda solution: (not solution.success, not solution.moves, solution.duration))
    if problem.goal_pose is not None and best.status is Status.SOLVED:
        best = _slid_end(best, problem.goal_pose, numbers, partial(_near, task, solve, until))
    goal = best.problem.x_goal[: problem.robot.nv]
    if best not in solutions:
        tried.append(GoalResult(goal, best.duration, refined=True))
    bound = _bound_of_all(task, solutions, max(until - time.perf_counter(), numbers.bound * options.time_limit))
    missed = transversality(problem, problem.goal_pose, goal, best.costates)
    certificate = replace(best.certificate.bounded(bound, best.duration), transversality=missed)
    tried.sort(key=lambda goal: goal.duration)
    elapsed = time.perf_counter() - started
    answer = replace(with_certificate(best, certificate), goals=tuple(tried), solve_time=elapsed)
    if task.stop.interrupted and answer.status is not Status.INTERRUPTED:
        said = f"{task.stop.word}; {answer.message}"
        answer = replace(answer, success=False, status=Status.INTERRUPTED, message=said)
    return ended_in_time(answer, options.time_limit) if task.stop.cut_short else answer


def _near(task: Task, solve: Solve, until: float, known: Solution, q: Array) -> Solution | None:
    """The solution for a goal near another one, from that one's motion; None: the time is up."""
    if task.stop:
        return None
    task.progress("the goal moved along the joint positions that reach its pose")
    near = task.for_problem(known.problem.variant(q_goal=q))
    return solve(near.with_options(guesses=(known.trajectory,), starts=1), until - time.perf_counter())


def _slid_end(
    best: Solution, goal: GoalPose, numbers: GoalPolicy, solve: Callable[[Solution, Array], Solution | None]
) -> Solution:
    """The fastest solution met while the goal descends along its pose, with steps of Barzilai and Borwein (1988).

    Args:
        best: a solution at one of the joint positions that reach the pose; returned unchanged without costates, or if
            no neighbour is faster.
        goal: pose at the goal.
        numbers: settings of the descent.
        solve: maps a solution and a new goal, shape (nv,), to the solution there; None: the time is up.
    """
    step = numbers.end_first
    for _ in range(numbers.end_solves):
        q = best.problem.x_goal[: best.problem.robot.nv]
        missed = transversality(best.problem, goal, q, best.costates)
        if (
            best.costates is None
            or missed is None
            or missed == np.inf
            or missed <= GAP_TOLERANCE / 10
            or step < numbers.end_least
        ):
            break
        gradient = end_gradient(best.problem.robot, goal, q, best.costates)
        steepest = float(np.linalg.norm(gradient))
        by = -min(step, numbers.end_largest) / steepest * gradient
        moved = slid(best.problem.robot, goal, q, by, best.problem.limits)
        other = None if moved is None else solve(best, moved)
        if moved is None or other is None:
            break
        if not other.success or other.costates is None or other.duration >= best.duration:
            step /= 4
            continue
        turned = end_gradient(best.problem.robot, goal, moved, other.costates)
        away, curvature = moved - q, float((moved - q) @ (turned - gradient))
        step = float(away @ away) / curvature * float(np.linalg.norm(turned)) if curvature > 0 else 2 * step
        best = other
    return best


def _bound_of_all(task: Task, solutions: list[Solution], seconds: float) -> float | None:
    """Lower bound on the duration to any goal of the problem, tried or not [s]; None: no bound is known."""
    if not task.options.bound or any(solution.lower_bound is None for solution in solutions):
        return None
    with stopping(seconds, task.stop) as stop:
        bound = least_duration(task.problem, stop.__bool__, task.policy.bound)
    if stop.cut_short:
        task.stop.cut()
    return bound
