"""Graph of a cycle: nodes are inverse-kinematics branches of its stops, edges the motions between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import reduce
from itertools import pairwise

import numpy as np

from armdyn.arrays import Array, Flags
from armdyn.cycle.cycle import Cycle
from armdyn.cycle.order import EXACT, best_order, order_of_many, shortest, through
from armdyn.cycle.posing import check_paths, problem_of
from armdyn.cycle.stops import candidates, limits_of, redundant, with_slid
from armdyn.errors import CycleError
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.problem.policy.search import CyclePolicy
from armdyn.optimal.problem.problem import MinimumTimeProblem

Arc = tuple[int, int]
"""A move from a stop: the numbers of the stop and of the move, from 0 on."""
Edge = tuple[int, int, int, int]
"""A move from a stop, from a branch of the stop to one of the move's end."""


@dataclass(frozen=True, eq=False)
class Tour:
    """A path through the graph of a cycle.

    Attributes:
        length: sum of the edges [s]; inf: there is no path.
        edges: in the order of execution.
        order: of the jobs.
    """

    length: float
    edges: tuple[Edge, ...]
    order: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class CycleGraph:
    """A cycle's moves between branches of its stops.

    Attributes:
        cycle: robot, start and steps.
        positions: branches of every stop: joint positions, each of shape (nv,).
        lengths: of every arc [s], by branches: durations where `solved`, else lower bounds; inf: there is no motion.
        bounds: of every arc, proven lower bounds, likewise.
        exact: masks of the lengths that are durations, or known to be infinite.
        solutions: of edges that are solved.
        refused: reasons of infeasible edges.
    """

    cycle: Cycle
    positions: tuple[tuple[Array, ...], ...]
    lengths: dict[Arc, Array]
    bounds: dict[Arc, Array]
    exact: dict[Arc, Flags]
    solutions: dict[Edge, Solution] = field(default_factory=dict)
    refused: dict[Edge, str] = field(default_factory=dict)

    @classmethod
    def of(cls, cycle: Cycle) -> CycleGraph:
        """The graph, its edges bounded by the velocity limits.

        A redundant arm's stops get further branches: those of the tours that are best by these bounds, slid along the
        self-motions.

        Raises:
            CycleError: a stop or a way point cannot be reached, or the arm cannot rest at a stop.
        """
        positions = candidates(cycle)
        check_paths(cycle, positions)
        if any(redundant(cycle, positions)):
            positions = with_slid(cycle, positions, cls.between(cycle, positions)._promising())
        return cls.between(cycle, positions)

    @classmethod
    def between(cls, cycle: Cycle, positions: tuple[tuple[Array, ...], ...]) -> CycleGraph:
        """Graph of the given branches of all stops."""
        speed = limits_of(cycle).velocity
        lengths = {}
        for stop, move in _arcs(cycle):
            begins, ends = np.array(positions[stop]), np.array(positions[move + 1])
            lengths[stop, move] = np.max(np.abs(ends[None] - begins[:, None]) / speed, axis=2)
        bounds = {arc: own.copy() for arc, own in lengths.items()}
        return cls(cycle, positions, lengths, bounds, {arc: np.zeros(own.shape, bool) for arc, own in lengths.items()})

    def _promising(self) -> list[list[int]]:
        """Branches of all stops on the shortest tours through each branch of one stop, in the order of the stops."""
        free = [k for k, each in enumerate(self.positions) if len(each) > 1]
        if not free:
            return []
        tours = set()
        for branch in range(len(self.positions[free[0]])):
            lengths = {arc: own.copy() for arc, own in self.lengths.items()}
            for (stop, move), own in lengths.items():
                if stop == free[0]:
                    own[np.arange(len(own)) != branch] = np.inf
                if move + 1 == free[0]:
                    own[:, np.arange(own.shape[1]) != branch] = np.inf
            tour = self.best(lengths)
            if np.isfinite(tour.length):
                tours.add((tour.length, tour.edges))
        found = []
        for _, edges in sorted(tours):
            at = {0: edges[0][2]} | {move + 1: j for _, move, _, j in edges}
            found.append([at[k] for k in range(len(self.positions))])
        return found

    def problem(self, edge: Edge) -> MinimumTimeProblem | None:
        """The problem of an edge; None: it is ill-posed, and the edge is refused."""
        stop, move, i, j = edge
        try:
            return problem_of(self.cycle, self.cycle.moves[move], self.positions[stop][i], self.positions[move + 1][j])
        except CycleError as error:
            self.refused[edge] = str(error)  # whose traceback holds the problem's geometry
            self.learn(edge, np.inf, exact=True)
            alike = [one == str(error) for other, one in self.refused.items() if other[:2] == edge[:2]]
            if sum(alike) >= CyclePolicy().alike and not any(other[:2] == edge[:2] for other in self.solutions):
                self.lengths[edge[:2]][:] = np.inf
                self.exact[edge[:2]][:] = True
            return None

    def learn(self, edge: Edge, length: float, exact: bool) -> None:
        """Replace a length by a better bound, or by a duration."""
        arc, branches = edge[:2], edge[2:]
        self.lengths[arc][branches] = length
        self.exact[arc][branches] = exact

    def learn_bound(self, edge: Edge, bound: float) -> None:
        """Raise the proven bound of an edge."""
        arc, branches = edge[:2], edge[2:]
        self.bounds[arc][branches] = max(bound, self.bounds[arc][branches])

    def open(self, tour: Tour) -> list[Edge]:
        """Edges of a tour whose durations are unknown."""
        return [edge for edge in tour.edges if not self.exact[edge[:2]][edge[2:]]]

    def best(self, lengths: dict[Arc, Array]) -> Tour:
        """The shortest tour."""
        cycle, order = self.cycle, tuple(range(len(self.cycle.jobs)))
        if cycle.order == "free":
            order = self._order(lengths)
        arcs = _sequence(cycle, order)
        length, way = shortest([lengths[arc] for arc in arcs], cycle.closed)
        edges = tuple((*arc, *pair) for arc, pair in zip(arcs, pairwise(way), strict=True))
        return Tour(length, edges, order)

    def bound(self, lengths: dict[Arc, Array]) -> float:
        """A lower bound on the length of every tour, in any order that the cycle allows [s]."""
        if self.cycle.order == "given" or len(self.cycle.jobs) <= EXACT:
            return self.best(lengths).length
        return order_of_many(_nearest(self._between(lengths)))[0]

    def _order(self, lengths: dict[Arc, Array]) -> tuple[int, ...]:
        between = self._between(lengths)
        if len(self.cycle.jobs) <= EXACT:
            return best_order(between, self.cycle.closed)[1]
        return order_of_many(_nearest(between))[1]

    def _between(self, lengths: dict[Arc, Array]) -> list[list[Array]]:
        """Lengths between the ends of jobs, the input of `best_order`."""
        cycle, jobs = self.cycle, _moves_of_jobs(self.cycle)
        first = len(self.positions[0])
        rows = []
        for last in [*(moves[-1] + 1 for moves in jobs), 0]:
            row = []
            for moves in jobs:
                if moves[-1] + 1 == last:
                    row.append(np.full((len(self.positions[last]),) * 2, np.inf))
                    continue
                inner = [lengths[last, moves[0]], *(lengths[move, move] for move in moves[1:])]
                row.append(reduce(through, inner))
            back = _back(cycle)
            home = np.zeros((len(self.positions[last]), first)) if back is None else lengths.get((last, back))
            row.append(np.full((first, first), np.inf) if home is None else home)
            rows.append(row)
        return rows


def _nearest(between: list[list[Array]]) -> Array:
    """The shortest length between each two jobs, by any branches."""
    return np.array([[float(np.min(one)) for one in row] for row in between])


def _moves_of_jobs(cycle: Cycle) -> list[list[int]]:
    """Numbers of the moves of every job, from 0 on."""
    number = {leg.step: k for k, leg in enumerate(cycle.moves)}
    return [[number[step] for step in job if step in number] for job in cycle.jobs]


def _back(cycle: Cycle) -> int | None:
    """Number of the move back to the start, which belongs to no job; None without such a move."""
    last = len(cycle.moves) - 1
    return None if any(last in moves for moves in _moves_of_jobs(cycle)) else last


def _sequence(cycle: Cycle, order: Sequence[int]) -> list[Arc]:
    """Arcs of a cycle for one order of its jobs."""
    jobs, back = _moves_of_jobs(cycle), _back(cycle)
    moves = [move for job in order for move in jobs[job]] + ([] if back is None else [back])
    return list(zip([0, *(move + 1 for move in moves[:-1])], moves, strict=True))


def _arcs(cycle: Cycle) -> list[Arc]:
    """All arcs that a tour may take."""
    if cycle.order == "given":
        return _sequence(cycle, range(len(cycle.jobs)))
    jobs, back = _moves_of_jobs(cycle), _back(cycle)
    lasts = [moves[-1] + 1 for moves in jobs]
    inner = [(move, move) for moves in jobs for move in moves[1:]]
    between = [(last, moves[0]) for moves in jobs for last in [0, *lasts] if last != moves[-1] + 1]
    return inner + between + ([] if back is None else [(last, back) for last in lasts])
