"""`solve_minimum_time`: search, refine, certify."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.arguments import expect, listener
from armdyn.errors import ProblemError
from armdyn.optimal.answer.assembly import assembled, failed
from armdyn.optimal.answer.goals import fastest_goal
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.bound.lower_bound import least_duration
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem
from armdyn.optimal.problem.stop import stopping
from armdyn.optimal.refine.bang import minimum_time
from armdyn.optimal.refine.constrained import constrained, with_clearances, without_obstacles
from armdyn.optimal.refine.curves import curves
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.refine.profiles import profiles
from armdyn.optimal.refine.slowing import slowed
from armdyn.optimal.refine.smooth import time_energy
from armdyn.optimal.search.candidates import SearchResult
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.policy.policy import Method
from armdyn.optimal.task.task import Task
from armdyn.parallel import concurrently, one_blas_thread

METHODS: dict[Method, Callable[[Task], tuple[list[Optimum], SearchResult]]] = {
    "profiles": profiles,
    "arcs": minimum_time,
    "time-energy": time_energy,
    "mesh": constrained,
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
        ProblemError: problem, options or progress has a wrong type, or a limit is so low that every motion takes more
            than an hour.
    """
    expect_problem(problem)
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    return solve_task(Task.of(problem, options, progress=listener(progress)))


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
    limit, numbers = task.options.time_limit if seconds is None else seconds, task.policy.landing
    with one_blas_thread():
        with (
            stopping(limit - min(numbers.check_part * limit, numbers.check_time), task.stop) as stop,
            _bounded(replace(task, stop=stop)) as task,
        ):
            optima, found = refined(task)
            bound = task.lower_bound()
        elapsed = time.perf_counter() - started
        return assembled(task, optima, found, elapsed, bound) if optima else failed(task, found, elapsed)


def refined(task: Task) -> tuple[list[Optimum], SearchResult]:
    """Optima by the methods of the policy's strategy, refined and replayed, and the statistics of their search."""
    strategy, optima, found = task.policy.strategy, list[Optimum](), SearchResult(())
    for method in strategy.methods:
        if optima and _certified(task, optima[-1]):
            break
        more, searched = _by(method, task)
        optima += [slowed(task, one) for one in more]
        listed, iterations = (*found.listed, *searched.listed), found.iterations + searched.iterations
        found = replace(searched, listed=listed, iterations=iterations)
        if method == "profiles" and any(one.usable(task.options.replay_tolerance) for one in more):
            break  # but for its replay's errors no motion is faster
    for method in strategy.fallback:
        if task.stop or _is_enough(task, optima):
            break
        task.progress(f"no usable motion so far, or a faster one collides: {method}")
        near = tuple(one.trajectory for one in optima if one.landed(task.policy.landing.far))
        more, searched = _by(method, task.with_options(guesses=near))
        optima += [slowed(task, one) for one in more]
        failed, iterations = (*found.failed, *searched.failed), found.iterations + searched.iterations
        found = replace(found, failed=failed, iterations=iterations)
    return optima, found


def _by(method: Method, task: Task) -> tuple[list[Optimum], SearchResult]:
    """Optima by one method; only curves avoid obstacles, the other methods ignore them, and clearances are checked."""
    free = without_obstacles(task) if method != "curves" else None
    if free is None:
        return METHODS[method](task)
    optima, searched = METHODS[method](free)
    return with_clearances(task, optima), searched


def _certified(task: Task, optimum: Optimum) -> bool:
    """Whether an optimum is certified, if only by the lower bound, and satisfies the path constraints."""
    bound = task.lower_bound()
    return optimum.certificate.bounded(bound, optimum.trajectory.duration).ok and not optimum.missed


def _is_enough(task: Task, optima: list[Optimum]) -> bool:
    """Whether an optimum is usable, and among obstacles no faster one collides: a path between may be faster."""
    near = task.options.replay_tolerance
    fastest = min((one.trajectory.duration for one in optima if one.usable(near)), default=np.inf)
    touching = [one for one in optima if task.problem.crowded and one.missed]
    return fastest < np.inf and all(one.trajectory.duration >= fastest for one in touching)


@contextmanager
def _bounded(task: Task) -> Iterator[Task]:
    """The task with the lower bound on its duration, computed concurrently if the strategy requests it."""
    if not (task.policy.strategy.bounded and task.options.bound):
        yield task
        return
    job = partial(least_duration, task.problem, task.stop.__bool__, task.policy.bound)
    with concurrently(job, task.workers) as bound:
        yield replace(task, lower_bound=bound)


LONGEST = 3600.0
"""Largest lower bound on the duration that is accepted [s]; beyond, a limit most likely has a wrong unit."""


def check_pace(problem: MinimumTimeProblem) -> None:
    """Refuse velocity, acceleration or jerk limits so low that the motion takes longer than `LONGEST`.

    Raises:
        ProblemError: names the limit, the joint, the least duration and a sufficient limit.
    """
    none = np.full(problem.robot.nv, np.inf)
    net = np.abs(problem.poses[-1] - problem.poses[0])
    limits = {
        "velocity": (problem.limits.velocity, np.sum(np.abs(np.diff(problem.fixed_poses, axis=0)), axis=0), 1.0),
        # From rest to rest: acceleration over half the way; with a jerk limit, four ramps of the acceleration.
        "acceleration": (problem.acceleration_limit, net, 4.0),
        "jerk": (problem.jerk_limit, net, 32.0),
    }
    for order, (name, (limit, way, factor)) in enumerate(limits.items(), start=1):
        if order > 1 and not problem.from_rest_to_rest:
            break
        limit = none if limit is None else np.asarray(limit)
        least = (factor * way / limit) ** (1 / order)
        joint = int(np.argmax(least))
        if least[joint] > LONGEST:
            unit = "m" if problem.robot.slides[joint] else "rad"
            per = f"{unit}/s{('', '²', '³')[order - 1]}"
            raise ProblemError(
                f"joint {problem.robot.joint_names[joint]!r} has {name} limit {limit[joint]:g} {per}: its way of "
                f"{way[joint]:.4g} {unit} takes {least[joint]:.3g} s at least, more than {LONGEST:g} s; give "
                f"`{name}_limit` of {factor * way[joint] / LONGEST**order:.2g} {per} or more"
            )
