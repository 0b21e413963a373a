"""All conditions along the way. To add one: write its file, and its line here."""

from difflib import get_close_matches

from armdyn.errors import ProblemError
from armdyn.optimal.conditions.clearance.obstacles import Obstacles
from armdyn.optimal.conditions.clearance.self_collision import SelfCollision
from armdyn.optimal.conditions.condition import Condition
from armdyn.optimal.conditions.limits.acceleration import AccelerationLimit
from armdyn.optimal.conditions.limits.frame_speed import FrameSpeedLimit
from armdyn.optimal.conditions.limits.jerk import JerkLimit
from armdyn.optimal.conditions.limits.torque_rate import TorqueRateLimit
from armdyn.optimal.conditions.via import ViaPoints
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.typed.numbers import numbers

CONDITIONS: tuple[type[Condition], ...] = (
    Obstacles,
    SelfCollision,
    ViaPoints,
    AccelerationLimit,
    JerkLimit,
    FrameSpeedLimit,
    TorqueRateLimit,
)


def conditions_of(problem: MinimumTimeProblem) -> tuple[Condition, ...]:
    """What a problem asks along the way: by its keywords, and as `conditions`."""
    by_keyword = (kind.asked_by(problem) for kind in CONDITIONS)
    found = [condition for condition in by_keyword if condition is not None]
    for condition in problem.conditions:
        if not isinstance(condition, Condition):
            raise ProblemError(f"{condition!r} has a name, but no rows and no check: derive it from Condition")
        found.append(condition)
    return tuple(found)


def options() -> dict[str, type[Condition]]:
    """Those that `--limit NAME=…` knows, by name."""
    return {kind.option: kind for kind in CONDITIONS if kind.option}


def condition_named(name: str) -> type[Condition]:
    """The one that `--limit NAME=…` means.

    Raises:
        ProblemError: none; with the nearest name.
    """
    known = options()
    if name not in known:
        near = get_close_matches(name, known, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known)}"
        raise ProblemError(f"--limit: no limit is called {name!r}; {hint}")
    return known[name]


def condition_from(text: str) -> Condition:
    """The condition that a text such as "tip-speed=0.25@tool0" asks for.

    Raises:
        ProblemError: it asks for none; in the words of --limit.
    """
    name, equals, rest = text.partition("=")
    kind = condition_named(name.strip())
    values, at, frame = rest.partition("@")
    if not equals or (at and not frame.strip()):
        raise ProblemError(f"--limit {text!r}: write {name}={kind.metavar}, with numbers")
    return kind.of_option(numbers(values, f"--limit {name}"), frame.strip() or None)
