"""`solve_cycle`: the branches of the stops that are fastest together, and the motions between them."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import expect, listener
from armdyn.cycle.branches import Edge, Lengths, edges_of, shortest, shortest_exactly
from armdyn.cycle.cycle import Cycle
from armdyn.cycle.posing import problem_of
from armdyn.cycle.solution import CycleLeg, CycleSolution
from armdyn.cycle.stops import candidates
from armdyn.errors import CycleError
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.bound.lower_bound import lower_bound
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.optimal.problem.status import Status
from armdyn.optimal.problem.stop import Stop, stopping
from armdyn.optimal.task.options import MinimumTimeOptions
from armdyn.parallel import in_processes

Array = NDArray[np.float64]


def solve_cycle(
    cycle: Cycle,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> CycleSolution:
    """The fastest cycle, over all branches of the inverse kinematics at its stops.

    The moves between the branches of neighbouring stops are the edges of a graph. Their lengths are bounded, by the
    velocity limits and then by `lower_bound`, and solved only on the way that is the shortest so far; so the result is
    the shortest of all ways, as if every edge had been solved.

    Args:
        cycle: what is to be done.
        options: of every move's solve; the time limit is that of the whole cycle.
        progress: called with a line of text on what is being tried.

    Returns:
        A `CycleSolution`; look at `usable` and `gap`. Ctrl-C returns what there is, with status "interrupted".

    Raises:
        CycleError: a step cannot be done, with its number and name.
        ProblemError: cycle, options or progress is something else.
    """
    expect(cycle, Cycle, "cycle", "pose it: Cycle(robot, start=…, steps=[Move(…), …])")
    options = MinimumTimeOptions() if options is None else expect(options, MinimumTimeOptions, "options")
    started, report = time.perf_counter(), listener(progress)
    with stopping(options.time_limit) as stop:
        search = _Search.of(cycle, options, stop, report)
        length, way = shortest_exactly(search.lengths, search.closed, search.work_out)
        answer = search.answer(way) if np.isfinite(length) else search.nothing()
    return replace(answer, solve_time=time.perf_counter() - started)


@dataclass(frozen=True, eq=False)
class _Search:
    """The graph of a cycle's moves between candidates, as far as it is known.

    Attributes:
        cycle: what is to be done.
        positions: candidates of every stop.
        problems: of every layer, by candidates; an error where the problem is ill-posed.
        lengths: durations and bounds.
        bounds: proven lower bounds [s], of the shape of the lengths.
        solutions: of edges that are solved.
        options: of every solve.
        stop: asked between solves.
        report: progress.
    """

    cycle: Cycle
    positions: tuple[tuple[Array, ...], ...]
    problems: tuple[dict[tuple[int, int], MinimumTimeProblem | CycleError], ...]
    lengths: Lengths
    bounds: tuple[Array, ...]
    options: MinimumTimeOptions
    stop: Stop
    report: Callable[[str], None]
    solutions: dict[Edge, Solution] = field(default_factory=dict)
    bounded: set[Edge] = field(default_factory=set)

    @classmethod
    def of(cls, cycle: Cycle, options: MinimumTimeOptions, stop: Stop, report: Callable[[str], None]) -> _Search:
        """The graph with the bounds of the velocity limits.

        Raises:
            CycleError: no problem of a leg is well-posed.
        """
        positions, problems, values = candidates(cycle), [], []
        for k, leg in enumerate(cycle.moves):
            posed: dict[tuple[int, int], MinimumTimeProblem | CycleError] = {}
            lengths = np.full((len(positions[k]), len(positions[k + 1])), np.inf)
            for i, q_start in enumerate(positions[k]):
                for j, q_goal in enumerate(positions[k + 1]):
                    try:
                        problem = problem_of(cycle, leg, q_start, q_goal)
                    except CycleError as error:
                        posed[i, j] = error
                        continue
                    posed[i, j] = problem
                    lengths[i, j] = problem.duration_bound()
            if not np.any(np.isfinite(lengths)):
                raise next(error for error in posed.values() if isinstance(error, CycleError))
            problems.append(posed)
            values.append(lengths)
        exact = tuple(np.isinf(lengths) for lengths in values)
        lengths = Lengths(tuple(values), exact)
        return cls(
            cycle, positions, tuple(problems), lengths, tuple(each.copy() for each in values), options, stop, report
        )

    @property
    def closed(self) -> bool:
        """Whether the last stop takes the candidate of the first."""
        return self.cycle.closed

    def work_out(self, edges: list[Edge]) -> bool:
        """Bound the edges that are not bounded yet where there is a choice, and solve the others."""
        chosen = [edge for edge in edges if edge not in self.bounded and np.sum(~self.lengths.exact[edge[0]]) > 1]
        self._bound(chosen)
        if not chosen:
            self._solve(edges)
        return not self.stop

    def _bound(self, edges: list[Edge]) -> None:
        jobs = [partial(_bound_of, self._problem(edge), self.stop) for edge in edges]
        for edge, bound in zip(edges, in_processes(jobs, self.options.workers), strict=True):
            layer, *pair = edge
            self.bounded.add(edge)
            self.bounds[layer][tuple(pair)] = max(bound, self.bounds[layer][tuple(pair)])
            self.lengths.set(edge, self.bounds[layer][tuple(pair)], exact=False)

    def _solve(self, edges: list[Edge]) -> None:
        left = self.stop.deadline - time.perf_counter()
        options = replace(self.options, time_limit=max(left, 1e-3))
        jobs = [partial(solve_minimum_time, self._problem(edge), options) for edge in edges]
        if len(jobs) == 1:
            found = [solve_minimum_time(self._problem(edges[0]), options, self.report)]
        for edge, solution in zip(edges, found if len(jobs) == 1 else in_processes(jobs, None), strict=True):
            layer, *pair = edge
            leg = self.cycle.moves[layer]
            self.solutions[edge] = solution
            if solution.lower_bound is not None:
                self.bounds[layer][tuple(pair)] = max(solution.lower_bound, self.bounds[layer][tuple(pair)])
            usable = f"{solution.duration:.6f} s" if solution.usable else solution.message
            self.report(f"step {leg.step} ({leg.name}), branch {edge[1] + 1} to {edge[2] + 1}: {usable}")
            self.lengths.set(edge, solution.duration if solution.usable else np.inf, exact=True)
            if solution.status is Status.INTERRUPTED:
                self.stop.interrupt()

    def _problem(self, edge: Edge) -> MinimumTimeProblem:
        problem = self.problems[edge[0]][edge[1:]]
        assert isinstance(problem, MinimumTimeProblem)  # noqa: S101  # others have infinite lengths
        return problem

    def answer(self, way: tuple[int, ...]) -> CycleSolution:
        """The cycle along a way, as far as its moves are solved."""
        legs, begin = list[CycleLeg](), 0.0
        for edge, leg, stop in zip(edges_of(way), self.cycle.moves, self.cycle.stops, strict=False):
            begin += self._rest(stop.rests)
            if edge not in self.solutions:
                break
            legs.append(CycleLeg(leg, self.solutions[edge], begin))
            begin += legs[-1].duration
        bound = shortest(self.bounds, self.closed)[0] + self.cycle.dwell
        whole = len(legs) == len(self.cycle.moves)
        status = Status.SOLVED if whole else self.stop.status if self.stop else Status.INFEASIBLE
        message = "every move is solved" if whole else self.stop.word
        return CycleSolution(self.cycle, status, message, tuple(legs), float(bound), len(self.solutions))

    def nothing(self) -> CycleSolution:
        """No way through all stops: the move of which none was found says why."""
        for layer, lengths in enumerate(self.lengths.values):
            if not np.any(np.isfinite(lengths)):
                leg = self.cycle.moves[layer]
                why = [one.message for (k, *_), one in self.solutions.items() if k == layer]
                errors = [str(error) for error in self.problems[layer].values() if isinstance(error, CycleError)]
                said = f"step {leg.step} ({leg.name}): {why[0]}" if why else errors[0]
                return CycleSolution(self.cycle, Status.INFEASIBLE, said, branches=len(self.solutions))
        said = "the moves that are possible do not meet at the same branches of the stops"
        return CycleSolution(self.cycle, Status.INFEASIBLE, said, branches=len(self.solutions))

    def _rest(self, steps: tuple[int, ...]) -> float:
        given = [self.cycle.steps[k - 1] for k in steps]
        return float(sum(getattr(step, "dwell", 0.0) for step in given))


def _bound_of(problem: MinimumTimeProblem, stop: Stop) -> float:
    bound = lower_bound(problem, stop.__bool__)
    return 0.0 if bound is None else bound.duration
