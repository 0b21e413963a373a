"""Study files: untrusted TOML, bounded, without code and without files outside its own folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

from armdyn.arguments import shown
from armdyn.errors import ProblemError
from armdyn.parsing.toml import Table, read_toml
from armdyn.studies.arms import arms_of
from armdyn.studies.problems import ARM, POSES, ArmProblems
from armdyn.studies.rows import Value
from armdyn.studies.settings import check_setting
from armdyn.studies.study import MAX_AXES, METHODS, Axis, Study
from armdyn.studies.tasks.registry import TASKS

_MAX_VALUES = 10_000
_MAX_POSES = 64
"""Names of poses that cases may have: for each the SRDFs by a URDF are read."""


def read_study(path: str | os.PathLike[str]) -> Study:
    """Read a study file; docs/sweeps.md describes it.

    Args:
        path: of a TOML file. Robots that it names as files lie in its folder or below.

    Raises:
        FileError: the file, or a robot's file, cannot be read.
        ProblemError: the file is no study; the message has the line and the remedy.
        ArmdynError: an arm is none.
    """
    table = read_toml(path)
    sections = {task.section: name for name, task in TASKS.items()}
    table.only(("task", "arms", "fixed", "vary", "sample", *sections))
    kind = TASKS[table.text("task", "minimum-time", tuple(TASKS))]
    for section, name in sections.items():
        if section in table.values and section != kind.section:
            raise table.error(section, f"[{section}] is for task = {name!r}; this study's is {kind.name!r}")
    arms = tuple(arms_of(table.table("arms"), _named_poses(table)))
    if not arms:
        raise table.error("arms", "no arm: write [arms.NAME] with robot, q_start and q_goal")
    signs, where, bare = kind.signs, dict[str, Table](), ArmProblems(arms=arms)
    fixed = dict[str, Value]()
    for own, name, value in _flat(table.table("fixed"), POSES):
        fixed[name], where[name] = _checked(own, name, value, signs, bare), table.table("fixed")
    axes = list[Axis]()
    for own, name, value in _flat(table.table("vary"), None):
        axes.append(_axis(own, name, value, signs, bare))
        where[name] = table.table("vary")
    if len(arms) > 1 and ARM not in where:
        axes.insert(0, Axis(name=ARM, values=tuple(arm.name for arm in arms)))
    if both := [axis.name for axis in axes if axis.name in fixed]:
        raise table.error("fixed", f"{both[0]} is both fixed and varied")
    task = kind.read(table.table(kind.section), ArmProblems(arms=arms, fixed=fixed), where)
    sample = table.table("sample")
    sample.only(("method", "count", "seed"))
    method: Any = sample.text("method", "grid", METHODS)
    count, seed = (sample.whole(name, 0, least=0) for name in ("count", "seed"))
    try:
        return Study(task=task, axes=tuple(axes), method=method, count=count, seed=seed)
    except ProblemError as error:
        of_an_axis = any(str(error).startswith(f"{axis.name} ") for axis in axes)
        raise table.table("vary" if of_an_axis or not sample.values else "sample").about(error) from None


def _flat(table: Table, into: tuple[str, ...] | None, way: str = "") -> Iterator[tuple[Table, str, Any]]:
    """Settings by their whole names, with the table that each stands in.

    Args:
        table: of settings; a name may lead into tables, `q_goal.joint2 = …`.
        into: names of the tables that hold settings; None: all but ranges.
        way: names on the way to the table, each with a dot.
    """
    for name, value in table.values.items():
        if isinstance(value, dict) and (name in into if into is not None else not {"from", "to"} & value.keys()):
            yield from _flat(table.table(name), None, f"{way}{name}.")
        else:
            yield table, f"{way}{name}", value
    if len(table.values) > MAX_AXES:
        raise table.error("", f"more than {MAX_AXES} settings")


def _named_poses(table: Table) -> dict[str, tuple[str, ...]]:
    """Poses that cases set by their names, as `[vary] q_goal = ["ready", "up"]` does."""
    found: dict[str, tuple[str, ...]] = {}
    for own in (table.table("fixed"), table.table("vary")):
        for pose in POSES:
            value = own.values.get(pose)
            names = [name for name in (value if isinstance(value, list) else [value]) if isinstance(name, str)]
            if len(names) > _MAX_POSES:
                raise own.error(pose, f"{pose} has {len(names)} names of poses; give at most {_MAX_POSES}")
            if names:
                found[pose] = tuple(names)
    return found


def _checked(table: Table, name: str, value: object, signs: Any, problems: ArmProblems) -> Value:
    with table.at(name.rpartition(".")[2]):
        return check_setting(name, value, signs, problems)


def _axis(table: Table, name: str, value: object, signs: Any, problems: ArmProblems) -> Axis:
    """An axis of [vary]: a list of values, or a table from, to, count, scale."""
    with table.at(name.rpartition(".")[2]):
        if isinstance(value, list):
            if not 1 <= len(value) <= _MAX_VALUES:
                raise ProblemError(f"{name} has {len(value)} values; give 1 to {_MAX_VALUES}")
            return Axis(name=name, values=tuple(check_setting(name, one, signs, problems) for one in value))
        if not isinstance(value, dict) or not {"from", "to"} <= value.keys():
            raise ProblemError(f"{name} is {shown(value)}; write a list, or {{from = A, to = B, count = N}}")
        if unknown := value.keys() - {"from", "to", "count", "scale"}:
            raise ProblemError(f"{name}: {min(unknown)} is not known; a range has from, to, count, scale")
        low, high = (check_setting(name, value[end], signs, problems) for end in ("from", "to"))
        if not all(isinstance(end, int | float) for end in (low, high)):
            raise ProblemError(f"{name} has no numbers for values: write a list")
        return Axis(name=name, low=low, high=high, count=value.get("count", 0), scale=value.get("scale", "linear"))
