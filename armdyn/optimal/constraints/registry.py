"""Registry of path constraints. To add one: write its class, and its line here."""

from difflib import get_close_matches

from armdyn.errors import ProblemError
from armdyn.optimal.constraints.clearance import ClearanceConstraint
from armdyn.optimal.constraints.constraint import PathConstraint
from armdyn.optimal.constraints.frame_limits import FrameRegion, FrameSpeedLimit
from armdyn.optimal.constraints.goal_region import ViaPoints
from armdyn.optimal.constraints.rate_limits import AccelerationLimit, JerkLimit, VelocityTaperLimit
from armdyn.optimal.constraints.torque_limits import RmsTorque, TorqueRateLimit, TorqueSpeedLimit
from armdyn.optimal.problem.problem import MinimumTimeProblem
from armdyn.parsing.numbers import numbers

PATH_CONSTRAINTS: tuple[type[PathConstraint], ...] = (
    ClearanceConstraint,
    ViaPoints,
    AccelerationLimit,
    JerkLimit,
    FrameSpeedLimit,
    FrameRegion,
    TorqueRateLimit,
    VelocityTaperLimit,
    TorqueSpeedLimit,
    RmsTorque,
)


def path_constraints_of(problem: MinimumTimeProblem) -> tuple[PathConstraint, ...]:
    """Path constraints of a problem: those of its arguments, and its `path_constraints`."""
    by_keyword = (kind.from_problem(problem) for kind in PATH_CONSTRAINTS)
    found = [constraint for constraint in by_keyword if constraint is not None]
    for constraint in problem.path_constraints:
        if not isinstance(constraint, PathConstraint):
            raise ProblemError(f"{constraint!r} has a name, but no rows and no check: derive it from PathConstraint")
        found.append(constraint)
    return tuple(found)


def options() -> dict[str, type[PathConstraint]]:
    """Path constraints with an option `--limit NAME=…`, by name."""
    return {kind.option: kind for kind in PATH_CONSTRAINTS if kind.option}


def path_constraint_named(name: str) -> type[PathConstraint]:
    """Path constraint class of `--limit NAME=…`.

    Raises:
        ProblemError: no such constraint; the message has the nearest name.
    """
    known = options()
    if name not in known:
        near = get_close_matches(name, known, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(known)}"
        raise ProblemError(f"--limit: no limit is called {name!r}; {hint}")
    return known[name]


def path_constraint_from(text: str) -> PathConstraint:
    """Parse a path constraint from a text such as "tip-speed=0.25@tool0".

    Raises:
        ProblemError: the text is invalid; the message refers to --limit.
    """
    name, equals, rest = text.partition("=")
    kind = path_constraint_named(name.strip())
    values, at, frame = rest.partition("@")
    if not equals or (at and not frame.strip()):
        raise ProblemError(f"--limit {text!r}: write {name}={kind.metavar}, with numbers")
    return kind.of_option(numbers(values, f"--limit {name}"), frame.strip() or None)
