"""Study files: untrusted TOML, bounded, without code and without files outside its own folder."""

import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from armdyn.arguments import shown
from armdyn.errors import ProblemError
from armdyn.models.robots.poses import pose_given, positions_of
from armdyn.models.robots.robot import Robot
from armdyn.models.tables import KEYS, robot_from, robot_table
from armdyn.optimal.problem_files import PROBLEM, only_tables
from armdyn.parsing.toml import Table, read_toml
from armdyn.studies.problems import ARM, POSES, ArmProblems, StudyArm, with_scene, without_files
from armdyn.studies.rows import Value
from armdyn.studies.settings import check_setting
from armdyn.studies.study import MAX_AXES, Axis, Study
from armdyn.studies.tasks.cycle import CycleTask
from armdyn.studies.tasks.registry import TASKS, section_of
from armdyn.studies.tasks.task import StudyTask

Check = Callable[[str, Any], Value]
"""Value of a setting, by its name and as given, if there is such a setting."""

MAX_ARMS = 64
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
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
        ArmdynError: an arm cannot be read.
    """
    table = without_files(read_toml(path))
    only_tables(table, ("task", "arms", "fixed", "vary", "sample", *map(section_of, TASKS)))
    kind: Any = TASKS[table.text("task", "minimum-time", tuple(TASKS))]
    for name, section in ((name, section_of(name)) for name in TASKS):
        if section in table.values and name != kind.name:
            raise table.error(section, f"[{section}] is for task = {name!r}; this study's is {kind.name!r}")
    if kind is CycleTask:
        return _cycle_study(table)
    arms = tuple(arms_of(table.table("arms"), _named_poses(table)))
    if not arms:
        raise table.error("arms", "no arm: write [arms.NAME] with robot, q_start and q_goal")
    where, bare = dict[str, Table](), ArmProblems(arms=arms)
    check: Check = partial(check_setting, signs=kind.signs, problems=bare)
    fixed = dict[str, Value]()
    for own, name, value in _flat(table.table("fixed"), POSES):
        with own.at(name.rpartition(".")[2]):
            fixed[name], where[name] = check(name, value), table.table("fixed")
    axes = list[Axis]()
    for own, name, value in _flat(table.table("vary"), None):
        axes.append(_axis(own, name, value, check))
        where[name] = table.table("vary")
    if len(arms) > 1 and ARM not in where:
        axes.insert(0, Axis(name=ARM, values=tuple(arm.name for arm in arms)))
    if both := [axis.name for axis in axes if axis.name in fixed]:
        raise table.error("fixed", f"{both[0]} is both fixed and varied")
    options, problems = table.table(section_of(kind.name)), ArmProblems(arms=arms, fixed=fixed)
    return _study(table, kind.read(options, problems, where), axes)


def _cycle_study(table: Table) -> Study:
    """A study of a cycle file."""
    table.only(("task", "vary", "sample", CycleTask.name))
    task = CycleTask.read(table.table(CycleTask.name))
    settings = _flat(table.table("vary"), None)
    return _study(table, task, [_axis(own, name, value, task.checked) for own, name, value in settings])


def _study(table: Table, task: StudyTask, axes: Sequence[Axis]) -> Study:
    """The study of a task along axes, with the table [sample] of its file."""
    sample = table.table("sample")
    sample.only(("method", "count", "seed"))
    try:
        return Study(task=task, axes=tuple(axes), **sample.values)
    except ProblemError as error:
        of_an_axis = any(str(error).startswith(f"{axis.name} ") for axis in axes)
        raise table.table("vary" if of_an_axis or not sample.values else "sample").about(error) from None


def _flat(table: Table, into: tuple[str, ...] | None, way: str = "") -> Iterator[tuple[Table, str, Any]]:
    """Settings by their full names, each with its table.

    Args:
        table: of settings; a name may lead into tables, `q_goal.joint2 = …`.
        into: names of the tables that hold settings; None: all but ranges.
        way: names on the way to the table, each with a dot.
    """
    for name, value in table.values.items():
        if isinstance(value, dict) and (name in into if into is not None else not _is_range(value)):
            yield from _flat(table.table(name), None, f"{way}{name}.")
        else:
            yield table, f"{way}{name}", value
    if len(table.values) > MAX_AXES:
        raise table.error("", f"more than {MAX_AXES} settings")


def _is_range(value: Mapping[str, Any]) -> bool:
    """Whether a table of [vary] is a range: `to` may also be the key of a cycle's move."""
    return "from" in value or isinstance(value.get("to"), int | float | str)


def _named_poses(table: Table) -> dict[str, tuple[str, ...]]:
    """Poses set by name in cases, such as `[vary] q_goal = ["ready", "up"]`."""
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


def _axis(table: Table, name: str, value: object, check: Check) -> Axis:
    """An axis of [vary]: a list of values, or a table from, to, count, scale."""
    with table.at(name.rpartition(".")[2]):
        if isinstance(value, list):
            if not 1 <= len(value) <= _MAX_VALUES:
                raise ProblemError(f"{name} has {len(value)} values; give 1 to {_MAX_VALUES}")
            return Axis(name=name, values=tuple(check(name, one) for one in value))
        if not isinstance(value, dict) or not {"from", "to"} <= value.keys():
            raise ProblemError(f"{name} is {shown(value)}; write a list, or {{from = A, to = B, count = N}}")
        if unknown := value.keys() - {"from", "to", "count", "scale"}:
            raise ProblemError(f"{name}: {min(unknown)} is not known; a range has from, to, count, scale")
        low, high = (check(name, value[end]) for end in ("from", "to"))
        if not all(isinstance(end, int | float) for end in (low, high)):
            raise ProblemError(f"{name} has no numbers for values: write a list")
        return Axis(name=name, low=low, high=high, count=value.get("count", 0), scale=value.get("scale", "linear"))


def arms_of(table: Table, varied: Mapping[str, tuple[str, ...]]) -> Iterator[StudyArm]:
    """The arms that a table [arms] describes.

    Args:
        table: of the study file; robots' files lie in its folder or below.
        varied: names of poses that cases set, of q_start, q_goal or both.

    Raises:
        ProblemError: the table describes none; the message says which line.
    """
    if len(table.values) > MAX_ARMS:
        raise table.error("", f"{len(table.values)} arms; a study has at most {MAX_ARMS}")
    for name in table.values:
        own = table.table(name)
        own.only(("robot", *POSES, *KEYS, *PROBLEM, "scene"))
        with table.at(name):
            if not _NAME.fullmatch(name):
                raise ProblemError(f"arm {shown(name)}: a name has letters, digits, dots, dashes, 64 at most")
        of_robot = {key: value for key, value in own.values.items() if key in KEYS}
        with own.at("robot" if "robot" in own.values else name):
            given = {"name": own.text("robot", name)} if not {"urdf", "mjcf", "spec"} & of_robot.keys() else {}
            lines = dict(own.lines or {})  # `robot` of a study is `name` of a robot's own table
            if (line := lines.get((*own.within, "robot"))) is not None:
                lines[*own.within, "name"] = line
            robot = robot_from(Table(own.path, of_robot | given, lines, own.within))
            described = robot_table(robot)
        with table.at(name):
            poses = {one: _positions(robot, one, pose) for pose, names in varied.items() for one in names}
        problem = {key: value for key, value in own.values.items() if key in (*PROBLEM, "scene") and key not in KEYS}
        problem = with_scene(problem, own, robot)
        if "goal_pose" not in problem or "q_goal" in problem or "q_goal" in varied:
            problem["q_goal"] = _end(own, "q_goal", robot, poses, varied)
        problem["q_start"] = _end(own, "q_start", robot, poses, varied)
        yield StudyArm(name=name, robot=described, problem=problem, poses=poses)


def _end(
    table: Table,
    pose: str,
    robot: Robot,
    poses: Mapping[str, list[float]],
    varied: Mapping[str, tuple[str, ...]],
) -> list[float]:
    """Joint positions [rad or m] at an end of the motion."""
    if pose in varied:
        return list(poses[varied[pose][0]])
    with table.at(pose):
        if pose not in table.values:
            joints = ", ".join(robot.joint_names)
            raise ProblemError(f"{table.called(pose)} is missing: {robot.nv} positions of {joints}, or a pose's name")
        return _positions(robot, table.values[pose], table.called(pose))


def _positions(robot: Robot, given: object, what: str) -> list[float]:
    """Positions of all joints [rad or m].

    Raises:
        ProblemError: they are not.
    """
    positions: list[float] = pose_given(robot, positions_of(robot, given, what), what).tolist()
    return positions
