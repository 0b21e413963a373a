"""A solved cycle as plain values, for result files: steps with their times, limits that decide these, and remedies."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from armdyn.cycle.costs import RAISED, CycleCost
from armdyn.cycle.cycle import Cycle
from armdyn.cycle.solution import CycleLeg, CycleSolution
from armdyn.cycle.steps import Grasp, Move, Release
from armdyn.files import attributes
from armdyn.models.scene.obstacles import payload_entry
from armdyn.models.values.spec import Payload
from armdyn.reprs import gap_words, joint_unit, percent, short_time

_QUANTITIES = {"torque limit": "torque", "velocity limit": "speed"}
"""Plain words for a limit of a joint."""
NEAR = 0.05
"""A cycle whose proven gap is no larger is near the fastest possible: the bound ignores obstacles and straight
segments."""
_NOTHING = 5e-7
"""Smallest difference between two durations [s]: the accuracy of the motions."""


def cycle_summary(solution: CycleSolution, before: Cycle, costs: Sequence[CycleCost]) -> dict[str, Any]:
    """A solved cycle as JSON values: null where a number is not known; docs/json.md has the keys.

    Args:
        solution: of a cycle.
        before: the cycle before its jobs were put in order, whose numbers the steps get.
        costs: of `cycle_costs`.
    """
    cycle = solution.cycle
    order = _numbers(before, cycle)
    whole = len(solution.legs) == len(cycle.moves)
    steps = list(_steps(solution, costs, order))
    largest = sorted(costs, key=lambda cost: -abs(cost.saved or 0.0))
    return {
        "success": solution.success and solution.usable,
        "status": str(solution.status),
        **attributes(solution, "message", "usable", "verdict", "lower_bound", "gap", "branches"),
        "assessment": str(solution),
        "duration": solution.duration if whole else None,
        "dwell": cycle.dwell,
        "closed": cycle.closed,
        "order": order,
        "steps": steps,
        "decides": [attributes(one, "limit", "joint", "part") for one in solution.shares],
        "costs": [_cost(cost, _number(cost.step, order)) for cost in largest],
        "checks": [{"name": name, "holds": holds, "said": said} for name, holds, said in _checks(solution)],
        "parts": list(_parts(cycle, steps)),
        "solve_time": round(solution.solve_time, 3),
    }


def _numbers(before: Cycle, cycle: Cycle) -> list[int]:
    """Original numbers of the steps of an ordered cycle."""
    left = dict(enumerate(before.steps, start=1))
    found = []
    for step in cycle.steps:
        found.append(next(k for k, one in left.items() if one is step))
        del left[found[-1]]
    return found


def _number(step: int, order: Sequence[int]) -> int:
    """Number of a step in the cycle before it was ordered; 0, and that of the way back, are unchanged."""
    return order[step - 1] if 1 <= step <= len(order) else step


def _cost(cost: CycleCost, number: int) -> dict[str, Any]:
    """A cost with its words, and the number of its step in the given cycle."""
    where = f"step {number} ({cost.name}) without {cost.condition}" if number else cost.condition
    took = "no motion was found" if cost.saved is None else "no difference"
    if cost.saved is not None and abs(cost.saved) >= _NOTHING:
        took = f"{'at most ' if cost.about else ''}{short_time(abs(cost.saved))} {'less' if cost.saved > 0 else 'more'}"
    return asdict(cost) | {"step": number, "said": f"{where}: {took}"}


def _steps(solution: CycleSolution, costs: Sequence[CycleCost], order: Sequence[int]) -> Iterator[dict[str, Any]]:
    """Solved steps in the order of the motion, with the return to the start."""
    cycle, legs = solution.cycle, {leg.leg.step: leg for leg in solution.legs}
    begin, last = 0.0, max(legs, default=0)
    for k in range(1, max(len(cycle.steps), last) + 1):
        back = k > len(cycle.steps)
        step = cycle.moves[-1].move if back else cycle.steps[k - 1]
        leg = legs.get(k)
        if isinstance(step, Move) and leg is None:
            return
        duration = leg.duration if leg else step.dwell if not isinstance(step, Move) else 0.0
        part = cycle.arms[min(k, len(cycle.steps))].payload
        own = [cost for cost in costs if cost.step == k]
        yield {
            "number": _number(k, order),
            "name": cycle.name_of(k),
            "kind": type(step).__name__.lower(),
            "begin": begin,
            "duration": duration,
            "share": duration / solution.duration,
            "carries": None if part is None else {"name": part.name, "mass": part.mass},
            "decided_by": _decided(leg, duration),
            "would_help": _remedy(leg, duration, own),
            **(_move(leg) if leg else {}),
        }
        begin += duration


def _move(leg: CycleLeg) -> dict[str, Any]:
    """Facts of a move only."""
    solution, near = leg.solution, leg.solution.clearance
    return {
        **attributes(solution, "usable", "message", "lower_bound", "gap", "via_times"),
        "decides": [attributes(one, "limit", "joint", "part") for one in solution.decides],
        "clearance": near and attributes(near, "distance", "body", "other", "sure"),
    }


def _decided(leg: CycleLeg | None, duration: float) -> str:
    """The limit that decides most of a step's time, in plain words; empty: unknown, or the step takes no time."""
    if leg is None:
        return f"a rest of {duration:g} s" if duration else ""
    if not leg.solution.decides:
        return ""
    most = leg.solution.decides[0]
    return f"{_QUANTITIES.get(most.limit, most.limit)} of {most.joint}, {100 * most.part:.0f} %"


def _remedy(leg: CycleLeg | None, duration: float, costs: Sequence[CycleCost]) -> str:
    """The change that saves most of a step's time, in plain words; empty: none is known."""
    choices = [(cost.saved, f"no {cost.condition.removeprefix('its ')}") for cost in costs if cost.saved and leg]
    if leg is None:
        choices.append((RAISED * duration, f"{percent(RAISED)} shorter"))
    else:
        more = f"{percent(RAISED)} more of it"
        choices += [(RAISED * one.part * duration, more) for one in leg.solution.decides[:1]]
    saved, words = max(choices, default=(0.0, ""))
    most = "at most " if leg is not None and words == more else ""
    return f"{words} saves {most}{short_time(saved)}" if saved >= _NOTHING else ""


def _checks(solution: CycleSolution) -> Iterator[tuple[str, bool | None, str]]:
    """Name, result (None: not known) and words of each check of the whole cycle."""
    legs = solution.legs
    good = sum(leg.solution.usable for leg in legs)
    yield "every move is executable", solution.usable, f"{good} of {len(solution.cycle.moves)} moves"
    if legs:
        worst = max(leg.solution.certificate.goal_error for leg in legs)
        lands = all(leg.solution.certificate.lands for leg in legs)
        yield (
            "replays reach the stops",
            lands,
            f"within {worst:.1e} {joint_unit(solution.cycle.robot.slides)}, each with its payload",
        )
    near = [leg.solution.clearance for leg in legs if leg.solution.clearance is not None]
    if near:
        sure, nearest = all(one.sure for one in near), min(near, key=lambda one: one.distance)
        yield "clear of obstacles", sure, nearest.bodies() + ("" if sure else "; not proven between samples")
    if solution.gap is not None and solution.lower_bound is not None:
        yield (
            "near the fastest possible",
            True if solution.gap <= NEAR else None,
            f"{gap_words(solution.gap)}: no cycle is faster than {solution.lower_bound:.4f} s",
        )


def _parts(cycle: Cycle, steps: Sequence[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Parts that the arm carries, with begin and end [s]; null: until the end."""
    held: tuple[Payload, float] | None = None if cycle.robot.payload is None else (cycle.robot.payload, 0.0)
    for one, step, arm in zip(steps, cycle.steps, cycle.arms[1:], strict=False):
        if held is not None and isinstance(step, Release):
            yield _part(cycle, *held, one["begin"])
            held = None
        elif isinstance(step, Grasp):
            held = arm.payload or step.part, one["begin"]
    if held is not None:
        yield _part(cycle, *held, None)


def _part(cycle: Cycle, part: Payload, begin: float, end: float | None) -> dict[str, Any]:
    frame = part.frame or cycle.robot.tip
    return {"part": payload_entry(part) | {"name": part.name, "frame": frame}, "begin": begin, "end": end}
