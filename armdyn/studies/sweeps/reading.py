"""A study from a TOML file, which may be a stranger's: bounded, no code in it, no file beyond its own folder."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from armdyn.arguments import numbers, shown
from armdyn.errors import ProblemError
from armdyn.files import read_bounded
from armdyn.models.mjcf.document import is_mjcf
from armdyn.optimal import MinimumTimeOptions
from armdyn.studies.sweeps.study import MAX_AXES, METHODS, Axis, Study
from armdyn.studies.sweeps.tasks.minimum_time import NEIGHBOURS, MinimumTime
from armdyn.studies.sweeps.tasks.settings import ARM, POSES, ArmRecipe, Source, Value, check_setting
from armdyn.studies.sweeps.tasks.task import Task
from armdyn.studies.sweeps.tasks.tracking import Tracking, check_settings
from armdyn.toml import Table, read_toml

MAX_ARMS = 64
MAX_ROBOT = 2**22
"""Of a study's own URDF or MJCF [bytes]: it is sent with every case."""
_MAX_VALUES = 10_000
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
_PAPER = ("r", "rr", "rrr")
_ASKED = ("task", "arms", "fixed", "vary", "sample", "search", "track")


def read_study(path: str | os.PathLike[str]) -> Study:
    """The study that a file describes; docs/sweeps.md says how.

    Args:
        path: of a TOML file. Robots that it names as files lie in its folder or below.

    Raises:
        FileError: it, or a robot's file, cannot be read.
        ProblemError: it is no study; the message says which line, and what would be right.
        ArmdynError: an arm is none.
    """
    table = read_toml(path)
    table.only(_ASKED)
    kind = table.text("task", "minimum-time", ("minimum-time", "track"))
    for section, of in (("search", "minimum-time"), ("track", "track")):
        if section in table.values and of != kind:
            raise table.error(section, f"[{section}] is for task = {of!r}; this study's is {kind!r}")
    arms = tuple(_arms(table.table("arms"), Path(path).absolute().parent))
    if not arms:
        raise table.error("arms", "no arm: write [arms.NAME] with robot, q_start and q_goal")
    signs = MinimumTime.signs if kind == "minimum-time" else Tracking.signs
    fixed = {name: _checked(where, name, value, signs, arms) for where, name, value in _flat(table.table("fixed"))}
    axes = [_axis(where, name, value, signs, arms) for where, name, value in _flat(table.table("vary"))]
    if len(arms) > 1 and ARM not in [axis.name for axis in axes] and ARM not in fixed:
        axes.insert(0, Axis(name=ARM, values=tuple(arm.name for arm in arms)))
    if both := [axis.name for axis in axes if axis.name in fixed]:
        raise table.error("fixed", f"{both[0]} is both fixed and varied")
    task = _minimum_time(table, arms, fixed) if kind == "minimum-time" else _tracking(table, arms, fixed, axes)
    sample = table.table("sample")
    sample.only(("method", "count", "seed"))
    method = sample.text("method", "grid", METHODS)
    with table.at("sample" if "sample" in table.values else "vary"):
        return Study(
            task=task,
            axes=tuple(axes),
            method=next(one for one in METHODS if one == method),
            count=sample.whole("count", 0, least=0),
            seed=sample.whole("seed", 0, least=0),
        )


def _minimum_time(table: Table, arms: tuple[ArmRecipe, ...], fixed: dict[str, Value]) -> Task:
    search = table.table("search")
    search.only(("effort", "starts", "seed", "time_limit", "neighbours"))
    given: dict[str, Any] = {name: value for name, value in search.values.items() if name != "neighbours"}
    with table.at("search"):
        options = MinimumTimeOptions(**given)
    neighbours = search.text("neighbours", "add", NEIGHBOURS)
    return MinimumTime(
        arms=arms, fixed=fixed, options=options, neighbours=next(one for one in NEIGHBOURS if one == neighbours)
    )


def _tracking(table: Table, arms: tuple[ArmRecipe, ...], fixed: dict[str, Value], axes: list[Axis]) -> Task:
    track = table.table("track")
    track.only(("controller", "reference", "duration", "tolerance"))
    given: dict[str, Any] = dict(track.values)
    with table.at("track"):
        task = Tracking(arms=arms, fixed=fixed, **given)
        check_settings(task.controller, task.reference, [*fixed, *(axis.name for axis in axes)])
    return task


def _flat(table: Table) -> Iterator[tuple[Table, str, Any]]:
    """Settings by their whole names: a joint's pose stands in a table of its own, or has a dot in its name."""
    for name, value in table.values.items():
        if name in POSES and isinstance(value, dict):
            inner = table.table(name)
            for joint, own in inner.values.items():
                yield inner, f"{name}.{joint}", own
        else:
            yield table, name, value
    if len(table.values) > MAX_AXES:
        raise table.error("", f"more than {MAX_AXES} settings")


def _checked(table: Table, name: str, value: object, signs: Any, arms: tuple[ArmRecipe, ...]) -> Value:
    with table.at(_key(table, name)):
        return check_setting(name, value, signs, arms)


def _axis(table: Table, name: str, value: object, signs: Any, arms: tuple[ArmRecipe, ...]) -> Axis:
    """What varies: a list of values, or a table from, to, count, scale."""
    key = _key(table, name)
    with table.at(key):
        if isinstance(value, list):
            if not 1 <= len(value) <= _MAX_VALUES:
                raise ProblemError(f"{name} has {len(value)} values; give 1 to {_MAX_VALUES}")
            return Axis(name=name, values=tuple(check_setting(name, one, signs, arms) for one in value))
        if not isinstance(value, dict) or not {"from", "to"} <= value.keys():
            raise ProblemError(f"{name} is {shown(value)}; write a list, or {{from = A, to = B, count = N}}")
        if unknown := value.keys() - {"from", "to", "count", "scale"}:
            raise ProblemError(f"{name}: {min(unknown)} is not known; a range has from, to, count, scale")
        low, high = (check_setting(name, value[end], signs, arms) for end in ("from", "to"))
        if isinstance(low, str) or isinstance(high, str):
            raise ProblemError(f"{name} has names for values: write a list")
        return Axis(name=name, low=low, high=high, count=value.get("count", 0), scale=value.get("scale", "linear"))


def _key(table: Table, name: str) -> str:
    return name.partition(".")[2] if table.within and table.within[-1] in POSES else name


def _arms(table: Table, folder: Path) -> Iterator[ArmRecipe]:
    if len(table.values) > MAX_ARMS:
        raise table.error("", f"{len(table.values)} arms; a study has at most {MAX_ARMS}")
    for name in table.values:
        own = table.table(name)
        own.only(("robot", *POSES))
        with table.at(name):
            if not _NAME.fullmatch(name):
                raise ProblemError(f"arm {shown(name)}: a name has letters, digits, dots, dashes, 64 at most")
        with own.at("robot" if "robot" in own.values else name):
            source, text = _source(own.text("robot", name), folder)
            joints = ArmRecipe(name=name, source=source, text=text, q_start=(), q_goal=()).robot().joint_names
        poses = {pose: _pose(own, pose, joints) for pose in POSES}
        yield ArmRecipe(name=name, source=source, text=text, **poses)


def _pose(table: Table, pose: str, joints: tuple[str, ...]) -> tuple[float, ...]:
    with table.at(pose):
        if pose not in table.values:
            raise ProblemError(f"{table.called(pose)} is missing: {len(joints)} positions [rad], {', '.join(joints)}")
        values = numbers(table.values[pose], table.called(pose), f"{len(joints)} numbers [rad]")
        if values.shape != (len(joints),):
            raise ProblemError(
                f"{table.called(pose)} has {values.size} numbers; {', '.join(joints)} need {len(joints)}"
            )
        return tuple(float(q) for q in values)


def _source(robot: str, folder: Path) -> tuple[Source, str]:
    """What a robot's name stands for: the paper's arm, a library's, or a file's content.

    Raises:
        ArmdynError: the file is not in the study's folder, or cannot be read.
    """
    if robot in _PAPER:
        return "paper", robot
    if not Path(robot).suffix:
        if not _NAME.fullmatch(robot):
            raise ProblemError(f"robot {shown(robot)}: r, rr, rrr, a library's name, or a .urdf or .xml file")
        return "library", robot
    place = (folder / robot).resolve()  # links followed
    if Path(robot).is_absolute() or not place.is_relative_to(folder.resolve()):
        raise ProblemError(f"robot {shown(robot)}: a study's files lie in its own folder or below")
    text = read_bounded(place, MAX_ROBOT).decode("utf-8", "replace")
    return ("mjcf" if is_mjcf(place) else "urdf"), text
