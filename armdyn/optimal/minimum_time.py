"""Minimum-time motions: from a problem to its solution."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.arguments import expect
from armdyn.codegen.deadline import NoTimeError
from armdyn.optimal.answer.assembly import assembled, ended_by_time, failed, fastest_goal
from armdyn.optimal.answer.solution import Solution, kinematic, without_motion
from armdyn.optimal.bound.lower_bound import least_duration
from armdyn.optimal.constraints.registry import TightenedConstraints
from armdyn.optimal.curves.curves import curves, rough_motions
from armdyn.optimal.curves.profiles import profiles
from armdyn.optimal.mesh.mesh import mesh
from armdyn.optimal.mesh.search import SearchResult
from armdyn.optimal.problem.checks import check_pace
from armdyn.optimal.problem.choices import MethodName
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem
from armdyn.optimal.problem.status import stopping
from armdyn.optimal.problem.task import Task
from armdyn.optimal.verify.optimum import Optimum, slowed
from armdyn.parallel import concurrently, one_blas_thread

METHODS: dict[MethodName, Callable[[Task], tuple[list[Optimum], SearchResult]]] = {
    "profiles": profiles,
    "mesh": lambda task: mesh(task, rough_motions),
    "curves": curves,
}
"""Refinement methods: each maps a task to its refined and replayed optima and the statistics of its search."""


def solve_minimum_time(
    problem: MinimumTimeProblem,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> Solution:
    """Find the fastest motion between two states, with its certificate.

    Many guesses are solved on a coarse mesh; the best different optima are solved on finer meshes, their arcs resolved
    to exact switching times, their torques replayed through Pinocchio's `aba` by two independent integrators, their
    costates checked. The answer is the fastest that lands. Arms of more than three joints move along curves instead,
    which are replayed, too.

    Args:
        problem: the minimum-time problem.
        options: defaults suit arms of one to seven joints.
        progress: called with a line of text on the current step.

    Returns:
        A `Solution`; check `success` and `certificate`. Ctrl-C returns the best motion so far, with status
        "interrupted".

    Raises:
        ProblemError: problem, options or progress has a wrong type, the method cannot solve the problem, or a limit is
            so low that every motion takes more than an hour.

    Warns:
        ArmdynWarning: an option that is set has no effect on the problem.
    """
    expect_problem(problem)
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    started, posed = time.perf_counter(), problem.without_torques() if problem.kinematic else problem
    task = Task.of(posed, options, progress=progress)
    task.warn_of_options()
    solution = solve_task(task, options.time_limit - (time.perf_counter() - started))
    task.warn_of_options(solution.calm if solution.moves else None)
    solution = replace(solution, followed=task.not_advised(solution.status))
    return kinematic(problem, solution) if problem.kinematic else solution


def solve_task(task: Task, seconds: float | None = None) -> Solution:
    """Solve a task within its time limit, by its policy.

    Args:
        task: problem, options and policy, see `Task.of`.
        seconds: rest of the time limit [s]; None: all of it.
    """
    started, problem = time.perf_counter(), task.problem
    check_pace(problem)
    if problem.goal_pose is not None or len(problem.goals) > 1:
        return fastest_goal(task, solve_task)
    limit, numbers = task.options.time_limit if seconds is None else seconds, task.policy.search
    with one_blas_thread():
        with (
            stopping(limit - min(numbers.check_part * limit, numbers.check_time), task.stop) as stop,
            _bounded(replace(task, stop=stop)) as task,
        ):
            try:
                optima, found = _first_quickly(task)
            except NoTimeError as error:
                why = f"{ended_by_time(task.options.time_limit)} before it began: {error}"
                return without_motion(problem, stop.status, stop.word if stop.interrupted else why)
            bound = task.lower_bound()
        elapsed = time.perf_counter() - started
        return assembled(task, optima, found, elapsed, bound) if optima else failed(task, found, elapsed)


def _first_quickly(task: Task) -> tuple[list[Optimum], SearchResult]:
    """`refined`, after a quick search where an end cannot be held, since there may be no motion."""
    weak = "; ".join(one.words for one in task.problem.weak_ends)
    if not weak or task.options.search != "normal" or task.options.starts is not None:
        return refined(task)
    task.progress(f"{weak}: there may be no motion, and a quick search comes first")
    optima, found = refined(task.with_options(search="quick"))
    if optima and not task.stop:
        return refined(task)
    said = "" if task.stop else "a quick search was made, and `search` thorough makes a long one"
    return optima, replace(found, remark=said)


def refined(task: Task) -> tuple[list[Optimum], SearchResult]:
    """Optima by the methods of the policy's strategy, refined and replayed, and the statistics of their search."""
    strategy, optima, found = task.policy.strategy, list[Optimum](), SearchResult(())
    for method in strategy.methods:
        if optima and _certified(task, optima[-1]):
            break
        more, new = _by(method, task)
        optima += [slowed(task, one) for one in more]
        found = replace(new, listed=(*found.listed, *new.listed), iterations=found.iterations + new.iterations)
        if method == "profiles" and any(one.usable for one in more):
            break  # but for its replay's errors no motion is faster
    for method in strategy.fallback:
        if task.stop or _is_enough(task, optima):
            break
        task.progress(f"no usable motion so far, or a faster one collides: {method}")
        near = tuple(one.trajectory for one in optima if one.certificate.ends_within(task.policy.shooting.far))
        last = replace(task, policy=task.policy.by(method))
        more, new = _by(method, last.with_options(guesses=near))
        optima += [slowed(task, one) for one in more]
        found = replace(found, failed=(*found.failed, *new.failed), iterations=found.iterations + new.iterations)
    return optima, found


def _by(method: MethodName, task: Task) -> tuple[list[Optimum], SearchResult]:
    """Optima by one method; curves alone avoid obstacles; others ignore them, and clearances are checked."""
    problem = task.problem
    if not problem.has_clearance or (method == "curves" and task.policy.strategy.curves_alone):
        return METHODS[method](task)
    task.progress("the motion without obstacles")
    optima, searched = METHODS[method](task.for_problem(problem.without_obstacles()))
    check = TightenedConstraints.of(task).check
    reports = (check(problem, one.trajectory, np.array(one.via_times)) for one in optima)
    return [replace(one, reports=each) for one, each in zip(optima, reports, strict=True)], searched


def _certified(task: Task, optimum: Optimum) -> bool:
    """Whether an optimum is certified, if only by the lower bound, and satisfies the path constraints."""
    bound = task.lower_bound()
    return optimum.certificate.bounded(bound, optimum.trajectory.duration).ok and not optimum.missed


def _is_enough(task: Task, optima: list[Optimum]) -> bool:
    """Whether an optimum is usable, and among obstacles no faster one collides: a path between may be faster."""
    fastest = min((one.trajectory.duration for one in optima if one.usable), default=np.inf)
    touching = [one for one in optima if task.problem.has_clearance and one.missed]
    return fastest < np.inf and all(one.trajectory.duration >= fastest for one in touching)


@contextmanager
def _bounded(task: Task) -> Iterator[Task]:
    """The task with the lower bound on its duration, computed concurrently if the strategy requests it."""
    if not (task.policy.strategy.bounded and task.options.bound):
        yield task
        return
    job = partial(least_duration, task.problem, task.stop.__bool__, task.policy.bound)
    with concurrently(job, task.workers, task.stop.__bool__, None) as bound:
        yield replace(task, lower_bound=bound)
