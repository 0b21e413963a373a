"""All conditions along the way. To add one: write its file, and its line here."""

from difflib import get_close_matches

from armdyn.errors import ProblemError
from armdyn.optimal.path_constraints.clearance.obstacles import Obstacles
from armdyn.optimal.path_constraints.clearance.self_collision import SelfCollision
from armdyn.optimal.path_constraints.constraint import Condition
from armdyn.optimal.path_constraints.limits.acceleration import AccelerationLimit
from armdyn.optimal.path_constraints.limits.frame_speed import FrameSpeedLimit
from armdyn.optimal.path_constraints.limits.jerk import JerkLimit
from armdyn.optimal.path_constraints.limits.torque_rate import TorqueRateLimit
from armdyn.optimal.path_constraints.via import ViaPoints
from armdyn.optimal.problem.problem import MinimumTimeProblem

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
