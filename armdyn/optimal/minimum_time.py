"""`solve_minimum_time`: search, refine, certify."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.arguments import expect, listener
from armdyn.arrays import Array
from armdyn.optimal.answer.assembly import assembled, ended_in_time, failed, with_certificate
from armdyn.optimal.answer.slid_end import slid_end
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.bound.lower_bound import lower_bound
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem
from armdyn.optimal.problem.slow_limits import check_pace
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop, stopping
from armdyn.optimal.proof.transversality import transversality
from armdyn.optimal.refine.bang import minimum_time
from armdyn.optimal.refine.constrained import constrained, with_clearances, without_obstacles
from armdyn.optimal.refine.curves import curves
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.refine.slowing import slowed
from armdyn.optimal.refine.smooth import time_energy
from armdyn.optimal.search.candidates import Found
from armdyn.optimal.search.goals import GoalTried, screened
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.policy.strategy import Method
from armdyn.optimal.task.task import Task
from armdyn.parallel import concurrently

METHODS: dict[Method, Callable[[Task], tuple[list[Optimum], Found]]] = {
    "arcs": minimum_time,
    "time-energy": time_energy,
    "mesh": constrained,
    "curves": curves,
}
"""Methods of refinement: each maps a task to its optima, refined and replayed, and the search that they come from."""


def solve_minimum_time(
    problem: MinimumTimeProblem,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> Solution:
    """The fastest motion between two states, and how far to trust it.

    Many guesses are solved on a coarse mesh; the best different optima are solved finer, their arcs
    resolved to exact switching times, their torques replayed through Pinocchio's `aba` by two independent
    integrators, their costates checked. The fastest that lands is the answer. Arms of more than three joints move
    along curves instead, replayed all the same.

    Args:
        problem: what is to be solved.
        options: defaults suit arms of one to seven joints.
        progress: called with a line of text on what is being tried.

    Returns:
        A `Solution`; look at `success` and `certificate`. Ctrl-C returns the best so far, with status
        "interrupted".

    Raises:
        ProblemError: problem, options or progress is something else, or a limit is so low that every motion takes more
            than an hour.
    """
    expect_problem(problem)
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    return solve_task(Task.of(problem, options, progress=listener(progress)))


def solve_task(task: Task, seconds: float | None = None) -> Solution:
    """Solve a task within its time limit, by its own policy.

    Args:
        task: what `solve_minimum_time` makes of its arguments.
        seconds: how much of the time limit is left [s]; None: all of it.
    """
    started, problem = time.perf_counter(), task.problem
    check_pace(problem)
    if problem.goal_pose is not None or len(problem.goals) > 1:
        return _fastest_goal(task)
    limit, numbers = task.options.time_limit if seconds is None else seconds, task.policy.landing
    with (
        stopping(limit - min(numbers.check_part * limit, numbers.check_time)) as stop,
        _bounded(replace(task, stop=stop)) as task,
    ):
        optima, found = refined(task)
        bound = task.lower_bound()
    elapsed = time.perf_counter() - started
    return assembled(task, optima, found, elapsed, bound) if optima else failed(task, found, elapsed)


def refined(task: Task) -> tuple[list[Optimum], Found]:
    """The optima that the methods of the policy's strategy find, refined and replayed, and their search."""
    strategy, optima, found = task.policy.strategy, list[Optimum](), Found(())
    for method in strategy.methods:
        if optima and _certified(task, optima[-1]):
            break
        more, searched = _by(method, task)
        optima += [slowed(task, one) for one in more]
        listed, iterations = (*found.listed, *searched.listed), found.iterations + searched.iterations
        found = replace(searched, listed=listed, iterations=iterations)
    for method in strategy.fallback:
        if task.stop or _is_enough(task, optima):
            break
        task.progress(f"nothing so far is usable, or what is faster touches something: {method}")
        near = tuple(one.trajectory for one in optima if one.landed(task.policy.landing.far))
        more, searched = _by(method, task.with_options(guesses=near))
        optima += [slowed(task, one) for one in more]
        failed, iterations = (*found.failed, *searched.failed), found.iterations + searched.iterations
        found = replace(found, failed=failed, iterations=iterations)
    return optima, found


def _by(method: Method, task: Task) -> tuple[list[Optimum], Found]:
    """Optima by one method; only curves go round obstacles, the others leave them out, and clearances are checked."""
    free = without_obstacles(task) if method != "curves" else None
    if free is None:
        return METHODS[method](task)
    optima, searched = METHODS[method](free)
    return with_clearances(task, optima), searched


def _certified(task: Task, optimum: Optimum) -> bool:
    """Whether an optimum is certified, by the lower bound if by nothing else, and satisfies the path constraints."""
    bound = task.lower_bound()
    return optimum.certificate.bounded(bound, optimum.trajectory.duration).ok and not optimum.missed


def _is_enough(task: Task, optima: list[Optimum]) -> bool:
    """Whether an optimum is usable, and among obstacles no faster one touches something: a way round may be between."""
    fastest = min((one.trajectory.duration for one in optima if _usable(task, one)), default=np.inf)
    touching = [one for one in optima if task.problem.crowded and one.missed]
    return fastest < np.inf and all(one.trajectory.duration >= fastest for one in touching)


def _usable(task: Task, optimum: Optimum) -> bool:
    return optimum.landed(task.options.replay_tolerance) and optimum.within_limits and not optimum.missed


@contextmanager
def _bounded(task: Task) -> Iterator[Task]:
    """The task with the lower bound on its duration, which is computed concurrently where the strategy asks for it."""
    if not (task.policy.strategy.bounded and task.options.bound):
        yield task
        return
    with concurrently(partial(_lower_bound, task), task.workers) as bound:
        yield replace(task, lower_bound=bound)


def _lower_bound(task: Task) -> float | None:
    """Lower bound on the duration [s]; None: none is known."""
    bound = lower_bound(task.problem, task.stop.__bool__, task.policy.bound)
    return None if bound is None else bound.duration


def _fastest_goal(task: Task) -> Solution:
    """The best of the solutions for the most promising goals, and the durations of all."""
    started, problem, options, numbers = time.perf_counter(), task.problem, task.options, task.policy.goals
    until = started + options.time_limit
    task = replace(task, stop=Stop(until))
    tasks, tried = screened(task)
    solutions: list[Solution] = []
    for i, branch in enumerate(tasks):
        if solutions and (task.stop or solutions[-1].status is Status.INTERRUPTED):
            break
        task.progress(f"goal {i + 1} of the {len(tasks)} best")
        solutions.append(solve_task(branch, max(until - time.perf_counter(), 1e-3)))
        found = solutions[-1].duration if solutions[-1].success else np.inf
        tried[i] = GoalTried(np.asarray(branch.problem.q_goal), found, refined=True)
    best = min(solutions, key=lambda solution: (not solution.success, not solution.moves, solution.duration))
    if problem.goal_pose is not None and best.status is Status.SOLVED:
        best = slid_end(best, problem.goal_pose, numbers, partial(_near, task, until))
    goal = best.problem.x_goal[: problem.robot.nv]
    if best not in solutions:
        tried.append(GoalTried(goal, best.duration, refined=True))
    bound = _bound_of_all(task, solutions, max(until - time.perf_counter(), numbers.bound * options.time_limit))
    missed = transversality(problem, problem.goal_pose, goal, best.phases)
    certificate = replace(best.certificate.bounded(bound, best.duration), transversality=missed)
    tried.sort(key=lambda goal: goal.duration)
    elapsed = time.perf_counter() - started
    answer = replace(with_certificate(best, certificate), goals=tuple(tried), solve_time=elapsed)
    return ended_in_time(answer, options.time_limit) if task.stop.cut_short else answer


def _near(task: Task, until: float, known: Solution, q: Array) -> Solution | None:
    """The solution for a goal near that of another one, from its motion; None: the time is up."""
    if task.stop:
        return None
    task.progress("the goal moved along the joint positions that reach its pose")
    near = task.about(known.problem.variant(q_goal=q))
    return solve_task(near.with_options(guesses=(known.trajectory,), starts=1), until - time.perf_counter())


def _bound_of_all(task: Task, solutions: list[Solution], seconds: float) -> float | None:
    """Lower bound on the duration to any goal of the problem, tried or not [s]; None: none is known."""
    if not task.options.bound or any(solution.lower_bound is None for solution in solutions):
        return None
    with stopping(seconds) as stop:
        bound = _lower_bound(replace(task, stop=stop))
    if stop.cut_short:
        task.stop.cut()
    return bound
