"""Costs of a cycle's conditions: how much sooner it would end without each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from armdyn.arguments import expect, listener
from armdyn.cycle.cycle import Cycle
from armdyn.cycle.graph import CycleGraph
from armdyn.cycle.posing import problem_of
from armdyn.cycle.solution import CycleLeg, CycleSolution
from armdyn.cycle.steps import Grasp, Move, Straight
from armdyn.errors import CycleError, ProblemError
from armdyn.models.robots.robot import Robot
from armdyn.optimal.minimum_time import solve_minimum_time
from armdyn.optimal.problem.status import Status
from armdyn.optimal.task.options import MinimumTimeOptions

MORE = 0.1
"""By which part limits are raised: 10 %."""


@dataclass(frozen=True)
class CycleCost:
    """What one condition of a cycle costs, all others kept.

    Attributes:
        step: number of the step, from 1 on; 0: the whole cycle.
        name: of the step.
        condition: such as "rest", "via 1", "straight approach".
        saved: time that the cycle would take less without it [s], negative: more; None: no motion was found.
        about: to first order, by the multipliers of the limits; else solved without the condition.
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
        return f"{where}{self.condition}: {'about ' if self.about else ''}{1e3 * self.saved:+.3g} ms saved"


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

    Raises:
        ProblemError: the solution is none, or not usable.
    """
    expect(solution, CycleSolution, "solution")
    if not solution.usable:
        raise ProblemError("costs are of a usable solution of a cycle")
    report, chosen = listener(progress), options or MinimumTimeOptions(search="quick")
    costs = [*_rests(solution), *_limits(solution)]
    for one in _solved(solution, chosen, report):
        if one is None:
            break
        costs.append(one)
    return tuple(costs)


def _rests(solution: CycleSolution) -> Iterator[CycleCost]:
    cycle = solution.cycle
    for k, step in enumerate(cycle.steps, start=1):
        if not isinstance(step, Move) and step.dwell:
            yield CycleCost(k, cycle.name_of(k), "its rest", step.dwell)


def _limits(solution: CycleSolution) -> Iterator[CycleCost]:
    for what, part in solution.decides:
        if what != "rests":
            yield CycleCost(0, "", f"10 % more of {what}", MORE * part * solution.duration, about=True)


def _solved(
    solution: CycleSolution, options: MinimumTimeOptions, report: Callable[[str], None]
) -> Iterator[CycleCost | None]:
    """Costs that take solves; None: they were interrupted."""
    for leg in solution.legs:
        for condition, move in _simpler(leg.leg.move):
            report(f"step {leg.leg.step} ({leg.leg.name}) without {condition}")
            yield _cost(leg, condition, solution.cycle, replace(leg, leg=replace(leg.leg, move=move)), options)
    for first, second in zip(solution.legs[:-1], solution.legs[1:], strict=True):
        if not solution.cycle.rest(solution.cycle.stops[solution.legs.index(second)]):
            report(f"steps {first.leg.step} and {second.leg.step} without the stop between them")
            yield _without_stop(solution, first, second, options)
    report("the nearest branches of all stops")
    yield _without_choice(solution, options)
    if any(isinstance(step, Grasp) for step in solution.cycle.steps):
        report("every move with the heaviest payload")
        yield _without_change(solution, options)


def _simpler(move: Move) -> Iterator[tuple[str, Move]]:
    """A move without each of its conditions."""
    for i in range(len(move.via)):
        yield f"via {i + 1}", replace(move, via=(*move.via[:i], *move.via[i + 1 :]))
    for name in ("retreat", "approach"):
        if isinstance(getattr(move, name), Straight):
            yield f"straight {name}", replace(move, **{name: None})
    if move.speed is not None:
        yield f"speed of {move.speed:g} m/s", replace(move, speed=None)


def _duration(cycle: Cycle, leg: CycleLeg, options: MinimumTimeOptions, robot: Robot | None = None) -> float | None:
    """Duration of a leg, solved anew between the same joint positions, perhaps by another arm; None: there is none."""
    ends = leg.solution.problem.poses[[0, -1]]
    own = leg.leg if robot is None else replace(leg.leg, robot=robot)
    try:
        found = solve_minimum_time(problem_of(cycle, own, *ends), options)
    except CycleError:
        return None
    if found.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    return found.duration if found.usable else None


def _cost(leg: CycleLeg, condition: str, cycle: Cycle, changed: CycleLeg, options: MinimumTimeOptions) -> CycleCost:
    duration = _duration(cycle, changed, options)
    saved = None if duration is None else leg.duration - duration
    return CycleCost(leg.leg.step, leg.leg.name, condition, saved)
