"""`solve_minimum_time`: search, refine, certify."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.arguments import expect, listener
from armdyn.optimal.answer.assembly import assembled, failed
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.bound.lower_bound import lower_bound, soonest
from armdyn.optimal.problem.problem import MinimumTimeProblem, expect_problem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop, stopping
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
from armdyn.processes import beside

_NEAR = 0.1
"""Of the goal [rad or m]: a replay that ends there is a guess to begin with."""

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
        ProblemError: problem, options or progress is something else.
    """
    started = time.perf_counter()
    expect_problem(problem)
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    tell = listener(progress)
    if len(problem.goals) > 1:
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
    if numbers.cruises and numbers.possible and not problem.along_the_way:
        return either
    if problem.along_the_way:
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
    certificate = best.certificate.bounded(_least(problem, branches, solutions), best.duration)
    tried.sort(key=lambda goal: goal.duration)
    return replace(best, certificate=certificate, goals=tuple(tried), solve_time=time.perf_counter() - started)


def _least(problem: MinimumTimeProblem, branches: list[MinimumTimeProblem], solutions: list[Solution]) -> float | None:
    """A duration that no motion to any of the goals beats [s]; None: none is known.

    Args:
        problem: with several goals.
        branches: with the most promising of them alone.
        solutions: of the first of these.
    """
    if not solutions or any(solution.lower_bound is None for solution in solutions):
        return None
    solved = {np.asarray(branch.q_goal).tobytes(): one for branch, one in zip(branches, solutions, strict=False)}

    def known(one: MinimumTimeProblem) -> float | None:
        solution = solved.get(np.asarray(one.q_goal).tobytes())
        if solution is not None:
            return solution.lower_bound
        bound = lower_bound(one)
        return None if bound is None else bound.duration

    return soonest(problem, known, float)
