"""Cycle files: a `Cycle` in TOML with the names of its Python arguments; see docs/cycles.md."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from armdyn.arguments import shown
from armdyn.cycle.cycle import CONDITIONS, Cycle
from armdyn.cycle.steps import Grasp, Move, Release, Step, Straight, Wait
from armdyn.errors import CycleError, ProblemError, did_you_mean
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.obstacles import PAYLOAD_KEYS, payload_from
from armdyn.models.tables import robot_from
from armdyn.models.values.spec import Payload
from armdyn.optimal import problem_files
from armdyn.optimal.problem.options import MinimumTimeOptions
from armdyn.optimal.problem_files import conditions_from, only_tables, place_from, via_from
from armdyn.parsing.toml import Table, read_toml

TABLES = ("robot", "cycle", "parts", "steps", "options")
OPTIONS = (*problem_files.OPTIONS, "bound_programs")
_KINDS = ("move", "grasp", "release", "wait")
_STRAIGHT = ("length", "axis", "frame", "deviation", "angle")
_CONDITIONS = ("obstacles", "path_constraints")
_MOVE = ("move", "to", "via", "retreat", "approach", "speed", *_CONDITIONS)
_KEYS = {
    "move": _MOVE,
    "grasp": ("grasp", "dwell", "name"),
    "release": ("release", "dwell", "name"),
    "wait": ("wait", "name"),
}


@dataclass(frozen=True, eq=False)
class CycleFile:
    """A cycle from a file, and the solver's options there.

    Attributes:
        cycle: robot, start and steps.
        options: of the solves.
        table: the whole file.
    """

    cycle: Cycle
    options: MinimumTimeOptions
    table: Table


def read_cycle(path: str | os.PathLike[str]) -> Cycle:
    """Read a cycle from a TOML file; see docs/cycles.md.

    The file may be untrusted: it is read up to a size, files that it names are inside its own folder, and
    nothing is downloaded.

    Raises:
        FileError: the file cannot be read, or is too large.
        ProblemError: it describes no cycle; the message has the line, and the right form.
    """
    return read_cycle_file(path).cycle


def read_cycle_file(path: str | os.PathLike[str]) -> CycleFile:
    """The cycle that a file describes, and the options of the solver.

    Raises:
        FileError: the file cannot be read, or is too large.
        ProblemError: it describes no cycle; the message says in which line.
    """
    file = read_toml(path)
    only_tables(file, TABLES)
    given = file.table("options")
    given.only(OPTIONS)
    with given.locating_errors():
        options = MinimumTimeOptions(**given.values)
    return CycleFile(cycle_from(file, robot_from(file.table("robot"))), options, file)


def cycle_from(file: Table, robot: Robot) -> Cycle:
    """The cycle that a file's tables describe, for a robot.

    Raises:
        ProblemError: a key is unknown or wrong; the message says in which line.
    """
    table = file.table("cycle")
    table.only(("start", "closed", "order", "scene", *CONDITIONS))
    parts = {name: _part(file.table("parts"), name) for name in file.table("parts").values}
    steps = [_step(each, robot, parts) for each in file.tables("steps")]
    with table.locating_errors({"start of the cycle": "start"}):
        if "start" not in table.values:
            raise ProblemError("[cycle] has no start: joint positions, a pose's name, or a goal pose")
        given = conditions_from(table, robot)
        start = place_from(table, "start", robot)
        with locating_steps(file):
            return Cycle(robot, **{**given, "start": start, "steps": steps})


def keys_of(step: Mapping[str, object]) -> tuple[str, ...]:
    """The keys that a step's table may have, first that of its kind; empty: it is no step."""
    return next((_KEYS[kind] for kind in _KINDS if kind in step), ())


@contextmanager
def locating_steps(file: Table) -> Iterator[None]:
    """Context that adds the line of its table to an error about a step; to one about start or way back that key's line.

    Raises:
        ProblemError: the complaint, with its line.
    """
    try:
        yield
    except CycleError as error:
        steps = file.tables("steps")
        if 0 < error.step <= len(steps):
            raise steps[error.step - 1].error("", str(error)) from None
        raise file.table("cycle").error("closed" if error.step else "start", str(error)) from None


def _part(table: Table, name: str) -> Payload:
    part = table.table(name)
    part.only(PAYLOAD_KEYS)
    with part.locating_errors({"payload": name}):
        return payload_from({"name": name, **part.values}, Path(table.path).parent)


def _step(table: Table, robot: Robot, parts: dict[str, Payload]) -> Step:
    """The step of a table: a move, grasp, release or wait."""
    kinds = [kind for kind in _KINDS if kind in table.values]
    if len(kinds) != 1:
        raise table.error("", f"a step has one of {', '.join(_KINDS)}; this one has {' and '.join(kinds) or 'none'}")
    (kind,) = kinds
    table.only(_KEYS[kind])
    with table.locating_errors():
        if kind == "move":
            return _move(table, robot)
        rest = {key: value for key, value in table.values.items() if key != kind}
        if kind == "wait":
            return Wait(table.values["wait"], **rest)
        name = table.values[kind]
        if not isinstance(name, str) or name not in parts:
            meant = did_you_mean(str(name), parts) or f"; known: {', '.join(parts)}"
            raise ProblemError(f"{kind} is {shown(name)}; it is a part of [parts]{meant}")
        return Grasp(parts[name], **rest) if kind == "grasp" else Release(parts[name], **rest)


def _move(table: Table, robot: Robot) -> Move:
    given = conditions_from(table, robot)
    if "to" not in given:
        raise table.error("move", "a move has no key 'to': joint positions, a pose's name, or a goal pose")
    return Move(
        place_from(table, "to", robot),
        name=given["move"],
        via=via_from(table, robot) if "via" in given else (),
        retreat=_straight(table, "retreat"),
        approach=_straight(table, "approach"),
        **{key: given[key] for key in ("speed", *_CONDITIONS) if key in given},
    )


def _straight(table: Table, key: str) -> Straight | None:
    """A straight segment: a table, or its length [m]; None: there is none."""
    value = table.values.get(key)
    if not isinstance(value, dict):
        return None if value is None else Straight(value)
    inner = table.table(key)
    inner.only(_STRAIGHT)
    if "length" not in value:
        raise table.error(key, f"{key} has no length [m]")
    with inner.locating_errors():
        return Straight(**value)
