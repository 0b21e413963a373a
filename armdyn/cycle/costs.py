"""Costs of a cycle's conditions: the time saved without each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from armdyn.arguments import expect, listener
from armdyn.arrays import Array
from armdyn.cycle.cycle import Cycle, Leg
from armdyn.cycle.graph import CycleGraph
from armdyn.cycle.posing import problem_of
from armdyn.cycle.solution import CycleLeg, CycleSolution
from armdyn.cycle.steps import Grasp, Move
from armdyn.errors import CycleError, ProblemError
from armdyn.models.scene.reaching import GoalPose
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem.status import Status

RAISED = 0.1
"""Fraction by which limits are raised: 10 %."""


@dataclass(frozen=True)
class CycleCost:
    """Time that one condition of a cycle costs, all others kept.

    Attributes:
        step: number of the step, from 1 on; 0: the whole cycle.
        name: of the step.
        condition: such as "rest", "via 1", "straight approach".
        saved: time saved without the condition [s], negative: time lost; None: no motion was found.
        about: to first order, by the multipliers of the limits, which is the most; else solved without the condition.
    """

    step: int
    name: str
    condition: str
    saved: float | None
    about: bool = False

    def __str__(self) -> str:
        where = f"step {self.step} ({self.name}): " if self.step else ""
        if self.saved is None:
            return f"{where}{self.condition}: no motion was found without it"
        return f"{where}{self.condition}: {'at most ' if self.about else ''}{1e3 * self.saved:+.3g} ms saved"


def cycle_costs(
    solution: CycleSolution,
    options: MinimumTimeOptions | None = None,
    progress: Callable[[str], None] | None = None,
) -> tuple[CycleCost, ...]:
    """Costs of rests, via points, straight segments, stops, limits, branches and the changing payload.

    Limits count by the multipliers of the motions; for each other condition the moves that it holds for are solved
    without it, between the same joint positions.

    Args:
        solution: of a cycle, usable.
        options: of the solves; by default a quick search.
        progress: called with a line of text before each solve.

    Returns:
        The costs; after Ctrl-C those so far.

    Raises:
        ProblemError: it is no solution of a cycle, or not usable.
    """
    expect(solution, CycleSolution, "solution")
    if not solution.usable:
        raise ProblemError("costs are of a usable solution of a cycle")
    quick = MinimumTimeOptions(search="quick")
    report, chosen = listener(progress), quick if options is None else expect(options, MinimumTimeOptions, "options")
    return (*_dwells(solution), *_limits(solution), *_solved(solution, chosen, report))


def _dwells(solution: CycleSolution) -> Iterator[CycleCost]:
    cycle = solution.cycle
    for k, step in enumerate(cycle.steps, start=1):
        if not isinstance(step, Move) and step.dwell:
            yield CycleCost(k, cycle.name_of(k), "its rest", step.dwell)


def _limits(solution: CycleSolution) -> Iterator[CycleCost]:
    for what, part in solution.decides:
        if what != "rests":
            yield CycleCost(0, "", f"10 % more of {what}", RAISED * part * solution.duration, about=True)


def _solved(solution: CycleSolution, options: MinimumTimeOptions, report: Callable[[str], None]) -> Iterator[CycleCost]:
    """Costs that need further solves, until an interrupt."""
    cycle, legs = solution.cycle, solution.legs
    with suppress(_Interrupted, KeyboardInterrupt):
        for one in legs:
            for condition, move in _simpler(one.leg.move):
                report(f"step {one.leg.step} ({one.leg.name}) without its {condition}")
                duration = _solve(cycle, replace(one.leg, move=move), one.solution.problem.poses[[0, -1]], options)
                yield CycleCost(one.leg.step, one.leg.name, f"its {condition}", _saving(one.duration, duration))
        for stop, (first, second) in zip(cycle.stops[1:], pairwise(legs), strict=False):
            if not stop.rests:
                report(f"steps {first.leg.step} and {second.leg.step} without the stop between them")
                yield _without_stop(cycle, first, second, options)
        if any(isinstance(stop.target, GoalPose) for stop in cycle.stops):
            report("the nearest branch at every stop")
            yield _nearest_branches(solution, options)
        if any(isinstance(step, Grasp) for step in cycle.steps):
            report("every move with the heaviest payload")
            arm = max(cycle.arms, key=lambda arm: arm.payload.mass if arm.payload else 0.0)
            found = [
                one.duration
                if one.leg.robot is arm
                else _solve(cycle, replace(one.leg, robot=arm), one.solution.problem.poses[[0, -1]], options)
                for one in legs
            ]
            total = None if None in found else sum(time for time in found if time is not None) + cycle.dwell
            yield CycleCost(0, "", "planning every move for the heaviest payload", _saving(solution.duration, total))


class _Interrupted(Exception):  # noqa: N818  # it ends a loop
    """Ctrl-C ended a solve."""


def _saving(duration: float, without: float | None) -> float | None:
    return None if without is None else duration - without


def _simpler(move: Move) -> Iterator[tuple[str, Move]]:
    """The move with one condition left out, for each of its conditions, after the condition's name."""
    for i in range(len(move.via)):
        yield f"via {i + 1}", replace(move, via=(*move.via[:i], *move.via[i + 1 :]))
    if move.retreat is not None:
        yield "straight retreat", replace(move, retreat=None)
    if move.approach is not None:
        yield "straight approach", replace(move, approach=None)
    if move.speed is not None:
        yield f"speed of {move.speed:g} m/s", replace(move, speed=None)


def _solve(cycle: Cycle, leg: Leg, ends: Array, options: MinimumTimeOptions) -> float | None:
    """Duration of a leg between joint positions, shape (2, nv) [s]; None: no motion was found."""
    try:
        found = solve_minimum_time(problem_of(cycle, leg, *ends), options)
    except CycleError:
        return None
    if found.status is Status.INTERRUPTED:
        raise _Interrupted
    return found.duration if found.usable else None


def _without_stop(cycle: Cycle, first: CycleLeg, second: CycleLeg, options: MinimumTimeOptions) -> CycleCost:
    """Cost of the stop between two moves: both as one move with a way point."""
    before, after = first.leg.move, second.leg.move
    via = first.solution.problem.poses[-1]
    ends = np.array([first.solution.problem.poses[0], second.solution.problem.poses[-1]])
    duration = None
    if before.approach is None and after.retreat is None and before.speed == after.speed:
        move = replace(after, via=(*before.via, via, *after.via), retreat=before.retreat)
        duration = _solve(cycle, replace(second.leg, move=move), ends, options)
    saved = _saving(first.duration + second.duration, duration)
    return CycleCost(first.leg.step, first.leg.name, "the stop at its end", saved)


def _nearest_branches(solution: CycleSolution, options: MinimumTimeOptions) -> CycleCost:
    """Cost of the cycle against that with the nearest branch at every stop, by the velocity limits."""
    graph = CycleGraph.of(solution.cycle)
    known = {edge: one.duration for edge, one in zip(_edges(graph, solution), solution.legs, strict=True)}
    total, branch = solution.cycle.dwell, _edges(graph, solution)[0][2]
    first = branch
    for k, leg in enumerate(solution.cycle.moves):
        ways = graph.lengths[k, k][branch]
        last = solution.cycle.closed and k == len(solution.cycle.moves) - 1
        edge = k, k, branch, first if last else int(np.argmin(ways))
        time = known.get(edge)
        if time is None:
            ends = np.array([graph.positions[k][edge[2]], graph.positions[k + 1][edge[3]]])
            time = _solve(solution.cycle, leg, ends, options)
        if time is None:
            return CycleCost(0, "", "taking the nearest branch at every stop", None)
        total, branch = total + time, edge[3]
    return CycleCost(0, "", "taking the nearest branch at every stop", solution.duration - total)


def _edges(graph: CycleGraph, solution: CycleSolution) -> list[tuple[int, int, int, int]]:
    """The edges of a solved cycle in a graph of its own, by the branches that are nearest to its stops."""
    branches = [
        int(np.argmin([np.max(np.abs(q - own)) for own in positions]))
        for q, positions in zip(solution.stops, graph.positions, strict=True)
    ]
    return [(k, k, i, j) for k, (i, j) in enumerate(pairwise(branches))]
