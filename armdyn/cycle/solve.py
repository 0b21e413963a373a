"""`solve_cycle`: the order and the branches of the stops that are fastest together, and the motions between them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from armdyn.arguments import expect, listener
from armdyn.cycle.cycle import Cycle
from armdyn.cycle.graph import CycleGraph, Edge, Tour
from armdyn.cycle.order_bound import order_bound
from armdyn.cycle.solution import CycleLeg, CycleSolution
from armdyn.cycle.stops import turns
from armdyn.errors import CycleError
from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.answer.assembly import ended_by_time
from armdyn.optimal.answer.solution import Solution, kinematic
from armdyn.optimal.bound.chain import chain_bound
from armdyn.optimal.bound.lattice import Effort
from armdyn.optimal.bound.lower_bound import least_duration
from armdyn.optimal.minimum_time import solve_task
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.policy.search import CyclePolicy, GoalPolicy
from armdyn.optimal.problem.status import Status, Stop, stopping
from armdyn.optimal.problem.task import Task
from armdyn.parallel import in_processes

Report = Callable[[str], None]


def solve_cycle(
    cycle: Cycle,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> CycleSolution:
    """The fastest cycle, over all branches of the inverse kinematics at its stops, and over the orders that it allows.

    The moves between the branches of neighbouring stops are the edges of a graph. Their lengths are bounded, by the
    velocity limits and then by `lower_bound`, and solved only on the tour that is the shortest so far; so the result
    is the shortest of all tours, as if every edge had been solved. `search="quick"` returns the first tour whose
    duration is not far above the bounds of all others.

    Args:
        cycle: robot, start and steps.
        options: of every move's solve; the time limit is that of the whole cycle.
        progress: called with a line of text before each solve.

    Returns:
        A `CycleSolution`; look at `usable` and `gap`. After Ctrl-C it has the moves solved so far, and status
        "interrupted".

    Raises:
        CycleError: a step is infeasible; the message has its number and name.
        ProblemError: cycle, options or progress is something else.
    """
    expect(cycle, Cycle, "cycle", "pose it: Cycle(robot, start=…, steps=[Move(…), …])")
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    started, report = time.perf_counter(), listener(progress)
    with stopping(options.time_limit) as stop:
        graph = CycleGraph.of(cycle)
        tour = _shortest(graph, options, stop, report)
        answer = _answer(graph, tour, stop, options.time_limit)
        if cycle.order == "free" and answer.usable and turns(cycle):
            answer = _with_turns(answer, options, stop, report)
        if options.bound:
            stop.deadline = max(stop.deadline, time.perf_counter() + GoalPolicy().bound * options.time_limit)
            programs = options.bound_programs or CyclePolicy().bound_programs
            effort = Effort(programs, stop.__bool__, options.workers, report)
            answer = replace(answer, lower_bound=_lower_bound(graph, answer, effort))
    if stop.interrupted:
        answer = replace(answer, status=stop.status, message=stop.word)
    return replace(answer, solve_time=time.perf_counter() - started)


def _shortest(graph: CycleGraph, options: MinimumTimeOptions, stop: Stop, report: Report) -> Tour:
    """Shortest tour, its edges solved; the shortest solved one if time is up or a quick search has enough.

    Edges of the tour that is the shortest by durations and bounds are solved until no edge of it is left.
    """
    bounded, known = dict[Edge, float | None](), Tour(np.inf, (), ())
    enough = 1 + CyclePolicy().quick if options.search == "quick" else 1.0
    while True:
        tour = graph.best(graph.lengths)
        edges = graph.open(tour)
        if known.length <= enough * tour.length and known.edges:
            return known
        if not edges or not np.isfinite(tour.length) or stop:
            return known if edges and known.edges else tour
        chosen = [edge for edge in edges if edge not in bounded and np.sum(~graph.exact[edge[:2]]) > 1]
        if chosen:
            bounded |= _bound(graph, chosen, options, stop)
        else:
            _solve(graph, edges, bounded, options, stop, report)
            solved = graph.best({arc: np.where(graph.exact[arc], own, np.inf) for arc, own in graph.lengths.items()})
            known = min(known, solved, key=lambda one: one.length)


def _with_turns(found: CycleSolution, options: MinimumTimeOptions, stop: Stop, report: Report) -> CycleSolution:
    """The cycle in the order found, with whole turns of the joints at its stops where that is faster.

    While the order is free, turns would make too many branches.
    """
    graph = CycleGraph.of(found.cycle)
    turned = _answer(graph, _shortest(graph, options, stop, report), stop, options.time_limit)
    best = turned if turned.usable and turned.duration < found.duration else found
    return replace(best, branches=found.branches + turned.branches)


def _bound(graph: CycleGraph, edges: list[Edge], options: MinimumTimeOptions, stop: Stop) -> dict[Edge, float | None]:
    """Lower bounds on the durations of edges [s], in parallel; None: unknown, or the edge is infeasible."""
    posed = [(edge, problem) for edge in edges if (problem := graph.problem(edge)) is not None]
    jobs = [partial(least_duration, problem, stop.__bool__) for _, problem in posed]
    found = dict[Edge, float | None].fromkeys(edges)
    for (edge, _), bound in zip(posed, in_processes(jobs, options.workers), strict=True):
        found[edge] = bound
        if bound is not None:
            graph.learn_bound(edge, bound)
            graph.learn(edge, max(bound, graph.lengths[edge[:2]][edge[2:]]), exact=False)
    return found


def _solve(
    graph: CycleGraph,
    edges: list[Edge],
    bounds: dict[Edge, float | None],
    options: MinimumTimeOptions,
    stop: Stop,
    report: Report,
) -> None:
    """Solve edges, in parallel where there are several, given the lower bounds of some of them [s]."""
    posed = [(edge, problem) for edge in edges if (problem := graph.problem(edge)) is not None]
    left, alone = max(stop.deadline - time.perf_counter(), 1e-3), report if len(posed) == 1 else None
    plain = [problem.without_torques() if problem.kinematic else problem for _, problem in posed]
    tasks = [Task.of(problem, options, stop, alone) for problem in plain]
    jobs = [partial(_solved, task, bounds.get(edge), left) for task, (edge, _) in zip(tasks, posed, strict=True)]
    for (edge, problem), solution in zip(posed, in_processes(jobs, options.workers), strict=True):
        solution = kinematic(problem, solution) if problem.kinematic else solution
        if solution.status is Status.INTERRUPTED and not solution.usable:
            continue  # its status is not the edge's
        leg, (_, _, i, j) = graph.cycle.moves[edge[1]], edge
        graph.solutions[edge] = solution
        if solution.lower_bound is not None:
            graph.learn_bound(edge, solution.lower_bound)
        outcome = f"{solution.duration:.6f} s" if solution.usable else solution.message
        report(f"step {leg.step} ({leg.name}), branch {i + 1} to {j + 1}: {outcome}")
        graph.learn(edge, solution.duration if solution.usable else np.inf, exact=True)


def _solved(task: Task, bound: float | None, left: float) -> Solution:
    """The solution of a move, in the time left [s]; its lower bound [s] may be known."""
    if bound is not None and task.policy.strategy.bounded:
        policy = task.policy.changed("strategy", bounded=False)
        task = replace(task, policy=policy, lower_bound=lambda: bound)
    return solve_task(task, left)


def _answer(graph: CycleGraph, tour: Tour, stop: Stop, limit: float) -> CycleSolution:
    """The cycle along a tour, up to its first unsolved move; `limit`: the time limit [s]."""
    if not np.isfinite(tour.length):
        status = stop.status if stop else Status.INFEASIBLE
        return CycleSolution(graph.cycle, status, _why(graph), branches=len(graph.solutions))
    cycle = graph.cycle.reordered(tour.order) if graph.cycle.order == "free" else graph.cycle
    legs, begin = list[CycleLeg](), 0.0
    for edge, leg, place in zip(tour.edges, cycle.moves, cycle.stops, strict=False):
        begin += cycle.rest(place)
        if edge not in graph.solutions:
            break
        legs.append(CycleLeg(leg, graph.solutions[edge], begin))
        begin += legs[-1].duration
    whole = len(legs) == len(cycle.moves)
    said = stop.word if stop.interrupted else ended_by_time(limit)
    status, message = (Status.SOLVED, "every move is solved") if whole else (stop.status, said)
    return CycleSolution(cycle, status, message, tuple(legs), None, len(graph.solutions))


def _lower_bound(graph: CycleGraph, found: CycleSolution, effort: Effort) -> float | None:
    """Lower bound on the duration of all cycles through the steps [s]; None: unknown."""
    cycle = found.cycle
    if not any(isinstance(place.target, GoalPose) for place in cycle.stops):
        return graph.bound(graph.bounds) + cycle.dwell
    if not found.usable or effort.stop():
        return None  # `graph.bounds` know sampled branches only
    effort.report("a lower bound of the whole cycle")
    moves, effort.others = found.duration - cycle.dwell, cycle.dwell
    if graph.cycle.order == "free":
        duration = order_bound(graph, moves, effort)
    else:
        problems = [leg.solution.problem for leg in found.legs]
        duration = chain_bound(problems, [place.target for place in cycle.stops], moves, effort)
    return duration + cycle.dwell if duration > 0 else None


def _why(graph: CycleGraph) -> str:
    """Reason for a missing tour: the message of the first infeasible move."""
    moves = graph.cycle.moves
    reasons = dict(graph.refused)
    for edge, one in graph.solutions.items():
        if not one.usable:
            reasons[edge] = str(CycleError(moves[edge[1]].step, moves[edge[1]].name, one.message))
    dead = [arc for arc, lengths in graph.lengths.items() if not np.any(np.isfinite(lengths))]
    edges = [edge for edge in reasons if edge[:2] in dead] or list(reasons)
    return reasons[min(edges, key=lambda edge: edge[1])]
