"""`solve_minimum_time`: search, refine, certify."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import expect, listener
from armdyn.optimal.answer.assembly import assembled, failed, with_certificate
from armdyn.optimal.answer.slid_end import slid_end
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.bound.lower_bound import lower_bound
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem
from armdyn.optimal.problem.slow_limits import check_pace
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop, stopping
from armdyn.optimal.proof.transversality import transversality
from armdyn.optimal.refine.bang import minimum_time
from armdyn.optimal.refine.constrained import constrained
from armdyn.optimal.refine.curves import curves
from armdyn.optimal.refine.optimum import Optimum
from armdyn.optimal.refine.slowing import slowed
from armdyn.optimal.refine.smooth import time_energy
from armdyn.optimal.search.candidates import Found
from armdyn.optimal.search.goals import GoalTried, screened
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.optimal.task.task import Task
from armdyn.parallel import beside

_LEAST_BOUND = 1.0
"""Time that the bound of all goals is given at least [s], whatever the search has left."""

_NEAR = 0.1
"""Of the goal [rad or m]: a replay that ends there is a guess to begin with."""

Array = NDArray[np.float64]
Strategy = Callable[[Task], tuple[list[Optimum], Found]]
"""From a task to its optima, refined and replayed, and the search that they come from."""


def solve_minimum_time(
    problem: MinimumTimeProblem,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> Solution:
    """The fastest motion between two states, and how far to trust it.

    Many guesses are solved on a coarse mesh; the best different optima are solved finer, their arcs
    resolved to exact switching times, their torques replayed through `pin.aba` by two independent
    integrators, their costates checked. The fastest that lands is the answer. Arms of more than three joints move
    along curves instead, replayed all the same.

    Args:
        problem: what is to be solved.
        options: defaults suit arms of one to seven joints.
        progress: told in words what is being tried.

    Returns:
        A `Solution`; look at `success` and `certificate`. Ctrl-C returns the best so far, with status
        "interrupted".

    Raises:
        ProblemError: problem, options or progress is something else, or a limit is so low that every motion takes more
            than an hour.
    """
    started = time.perf_counter()
    check_pace(expect_problem(problem))
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    tell = listener(progress)
    if problem.goal_pose is not None or len(problem.goals) > 1:
        return _fastest_goal(problem, options, tell)
    with stopping(options.time_limit) as stop:
        task = Task.of(problem, options, stop, tell)
        with beside(partial(_floor, problem, stop), task.workers if _bounded(task) else 1) as floor:
            task = replace(task, floor=floor) if _bounded(task) else task
            optima, found = _usable(task, *_strategy(task)(task))
            least = task.floor()
    elapsed = time.perf_counter() - started
    return assembled(task, optima, found, elapsed, least) if optima else failed(task, found, elapsed)


def _bounded(task: Task) -> bool:
    """Whether velocity limits shape the motion, so that a bound by them says something."""
    return task.policy.curves.cruises and not task.problem.pays_effort


def _floor(problem: MinimumTimeProblem, stop: Stop) -> float | None:
    """A duration that no motion beats [s]."""
    bound = lower_bound(problem, stop.__bool__)
    return None if bound is None else bound.duration


def _strategy(task: Task) -> Strategy:
    problem, numbers = task.problem, task.policy.curves
    if numbers.alone:
        return curves
    if numbers.cruises and numbers.possible and not problem.path_constraint_names:
        return either
    if problem.path_constraint_names:
        return constrained
    return time_energy if problem.pays_effort else minimum_time


def _usable(task: Task, optima: list[Optimum], found: Found) -> tuple[list[Optimum], Found]:
    """The optima and, where none of them is usable, curves that begin near the best of them."""
    optima, tolerance = _slowed(task, optima), task.options.replay_tolerance
    good = any(one.landed(tolerance) and one.within_limits and not one.missed for one in optima)
    if good or task.stop or task.policy.curves.alone or not task.policy.curves.possible:
        return optima, found
    task.tell("nothing so far is usable: curves, which are motions whatever comes out")
    near = tuple(one.trajectory for one in optima if one.landed(_NEAR))
    more, besides = curves(task.with_options(guesses=near))
    return [*optima, *_slowed(task, more)], replace(found, iterations=found.iterations + besides.iterations)


def _slowed(task: Task, optima: list[Optimum]) -> list[Optimum]:
    """Every optimum as slow as it must be: the one place where strategies end."""
    return [slowed(task, one) for one in optima]


def either(task: Task) -> tuple[list[Optimum], Found]:
    """Optima as curves and, unless these are proven to be as fast as can be, as arcs."""
    optima, found = curves(task)
    optima = _slowed(task, optima)
    floor = task.floor()
    if optima and optima[-1].certificate.bounded(floor, optima[-1].trajectory.duration).ok and not optima[-1].missed:
        return optima, found
    more, besides = minimum_time(task)
    listed = (*found.listed, *besides.listed)
    return [*optima, *more], replace(besides, listed=listed, iterations=found.iterations + besides.iterations)


def _fastest_goal(problem: MinimumTimeProblem, options: MinimumTimeOptions, tell: Callable[[str], None]) -> Solution:
    """The best of the solutions for the most promising goals, and the durations of all."""
    started = time.perf_counter()
    branches, tried = screened(problem, options, tell)
    solutions: list[Solution] = []
    for i, branch in enumerate(branches):
        left = options.time_limit - (time.perf_counter() - started)
        if solutions and (left <= 0 or solutions[-1].status is Status.INTERRUPTED):
            break
        tell(f"goal {i + 1} of the {len(branches)} best")
        solutions.append(solve_minimum_time(branch, replace(options, time_limit=max(left, 1e-3)), tell))
        tried[i] = GoalTried(tried[i].q, solutions[-1].duration if solutions[-1].success else np.inf, refined=True)
    best = min(solutions, key=lambda solution: (not solution.success, not solution.moves, solution.duration))
    until = started + options.time_limit
    if problem.goal_pose is not None and best.status is Status.SOLVED:
        best = slid_end(best, problem.goal_pose, partial(_near, options, until, tell))
    goal = best.problem.x_goal[: problem.robot.nv]
    if best not in solutions:
        tried.append(GoalTried(goal, best.duration, refined=True))
    bound = _bound_of_all(problem, solutions, max(until - time.perf_counter(), _LEAST_BOUND))
    certificate = best.certificate.bounded(bound, best.duration).at_goal(
        transversality(problem, problem.goal_pose, goal, best.phases)
    )
    tried.sort(key=lambda goal: goal.duration)
    elapsed = time.perf_counter() - started
    return replace(with_certificate(best, certificate), goals=tuple(tried), solve_time=elapsed)


def _near(
    options: MinimumTimeOptions, until: float, tell: Callable[[str], None], known: Solution, q: Array
) -> Solution | None:
    """The solution for a goal near that of another one, from its motion; None: the time is up."""
    left = until - time.perf_counter()
    if left <= 0:
        return None
    tell("the goal moved along the joint positions that reach its pose")
    options = replace(options, guesses=(known.trajectory,), starts=1, time_limit=left)
    return solve_minimum_time(known.problem.variant(q_goal=q), options, tell)


def _bound_of_all(problem: MinimumTimeProblem, solutions: list[Solution], seconds: float) -> float | None:
    """Lower bound on the duration to any goal of the problem, tried or not [s]; None: none is known."""
    if any(solution.lower_bound is None for solution in solutions):
        return None
    with stopping(seconds) as stop:
        return _floor(problem, stop)
