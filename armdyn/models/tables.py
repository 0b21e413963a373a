"""The table [robot] of problem, cycle and study files: its reader and writer."""

import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from armdyn.arguments import shown
from armdyn.errors import SpecError
from armdyn.models.mjcf.reading import read_mjcf
from armdyn.models.reading.urdf_xml import read_urdf
from armdyn.models.robots.poses import position_of
from armdyn.models.robots.robot import Robot
from armdyn.models.robots.source import RobotOptions, RobotSource
from armdyn.models.scene.obstacles import PAYLOAD_KEYS, TOOL_KEYS, payload_entry, payload_from, tool_from
from armdyn.models.values.actuator_limits import torque_speed_entry
from armdyn.models.values.placement import POSE_KEYS, pose_entry, pose_from
from armdyn.models.values.spec import PLANAR_ARMS, ArmSpec, LinkSpec
from armdyn.parsing.numbers import FREE
from armdyn.parsing.toml import Table

_SOURCES = ("name", "urdf", "mjcf", "spec")
_NUMBERS = (
    "effort_limit", "velocity_limit", "armature", "rotor_inertia", "gear_ratio", "damping", "friction",
    "friction_width", "passive",
)  # fmt: skip
_INNER: dict[str, tuple[str, ...] | None] = {
    "payload": PAYLOAD_KEYS, "tool": TOOL_KEYS, "lock": None, "mount": POSE_KEYS, "torque_speed": None,
    "inertias": None,
}  # fmt: skip
"""The tables in [robot], and the keys of each; None: names of joints."""
KEYS = (*_SOURCES, "arm", *_INNER, *_NUMBERS, "limits", "likely")
"""The keys of [robot]."""
_LIKELY = ("payload", "inertias", "armature", "damping", "friction", "friction_width")
"""The keys of [[robot.likely]]; the others are those of [robot]."""

_WORDS = {
    "payload": "payload",
    "tool": "tool",
    "mount": "mount",
    "--lock": "lock",
    "no robot": "name",
    "no such file": "name",
}
"""Words in messages, and the key of [robot] that each concerns."""


def robot_from(table: Table, mass: float | None = None) -> Robot:
    """The robot that a table [robot] describes.

    Args:
        table: the table [robot]; a file named there is inside the folder of the table's file.
        mass: mass of the payload [kg], instead of the table's; None: the table's.

    Raises:
        ProblemError: a key is unknown or wrong; the message has the line.
    """
    table.only(KEYS)
    with table.locating_errors(_WORDS):
        given, folder = table.values, Path(table.path).parent
        inner: dict[str, Any] = {key: _inner(table, key, known) for key, known in _INNER.items() if key in given}
        carried = dict(inner.pop("payload", {}))
        if mass is not None:
            carried = {**carried, "mass": mass} if mass or "shapes" in carried else {}
        if carried:
            inner["payload"] = payload_from(carried, folder)
        if "tool" in inner:
            inner["tool"] = tool_from(inner["tool"], folder)
        if "lock" in inner:
            inner["lock"] = {joint: q if q == FREE else position_of(q, "lock") for joint, q in inner["lock"].items()}
        if "mount" in inner:
            inner["mount"] = pose_from(inner["mount"], "mount")
        ends = given.get("arm")
        if "arm" in given and not (isinstance(ends, list) and len(ends) == 2 and all(isinstance(e, str) for e in ends)):
            raise table.error("arm", f"arm is {shown(ends)}; it is two joints or links: ['first', 'last']")
        numbers = {key: given[key] for key in _NUMBERS if key in given}
        robot = Robot.from_source(_source(table), RobotOptions(arm=ends, **inner, **numbers))
        if "limits" in given:
            rows = _inner(table, "limits", tuple(robot.limits.rows))
            robot = replace(robot, limits=replace(robot.limits, **rows))
        return robot


def robot_table(robot: Robot, folder: str | os.PathLike[str] | None = None) -> dict[str, Any]:
    """The table [robot] that describes a robot.

    Args:
        robot: a robot from one of the readers, changed at most in payload, inertias, limits, rotors and friction.
        folder: folder of the problem file: a robot's file inside it is referred to by name. Else the table contains its
            text.

    Raises:
        SpecError: the robot was made from a Pinocchio model, or changed otherwise, which no table describes.
    """
    origin, options = robot.origin, robot.options
    if origin is None or origin.model is not None:
        raise SpecError(f"{robot.source} has no file and no text: a problem file cannot describe it")
    lock, inertias = options.lock or {}, options.inertias or {}
    entries = {
        "lock": {joint: q if isinstance(q, str) else float(q) for joint, q in lock.items()},
        "arm": options.arm and list(options.arm),
        "mount": options.mount and pose_entry(np.array(options.mount), turned=True),
        "payload": robot.payload and payload_entry(robot.payload),
        "inertias": {joint: np.asarray(own, dtype=float).tolist() for joint, own in inertias.items()},
        "tool": options.tool and payload_entry(options.tool),
    }
    written = _written_source(origin, folder) | {key: entry for key, entry in entries.items() if entry}
    read = {name: getattr(options, name) for name in ("tool", "lock", "arm", "mount", "inertias")}
    plain = Robot.from_source(origin, RobotOptions(payload=robot.payload, **read))
    if robot.joint_names != plain.joint_names or robot.tip != plain.tip:
        raise SpecError(f"{robot.source}: joints or tip were changed after it was read: no problem file describes it")
    rows = {name: (own, plain.limits.rows[name]) for name, own in robot.limits.rows.items()}
    if changed := {name: own.tolist() for name, (own, read) in rows.items() if not np.array_equal(own, read)}:
        written["limits"] = changed
    if curves := torque_speed_entry(robot.limits.actuators):
        written["torque_speed"] = curves
    pairs = [(one.model.armature, *one.friction.per_joint(robot.nv)) for one in (robot, plain)]
    for name, own, read in zip(("armature", "damping", "friction"), *pairs, strict=True):
        if not np.array_equal(own, read):
            written[name] = own.tolist()
    if not np.array_equal(robot.friction.width, plain.friction.width):
        written["friction_width"] = robot.friction.listed_width
    again = plain.with_armature(robot.model.armature).with_friction(*pairs[0][1:], robot.friction.width)
    if again.model_hash != robot.model_hash:
        raise SpecError(
            f"{robot.source}: its model or its file was changed after it was read: no problem file describes it"
        )
    return written


def likely_from(table: Table) -> tuple[Robot, ...]:
    """Likely arms of a table [robot], which fit the same log as well as the identified arm; empty without any.

    Raises:
        ProblemError: a key is unknown or wrong; the message has the line.
    """
    shared = {key: value for key, value in table.values.items() if key != "likely"}
    arms = table.tables("likely")
    for one in arms:
        one.only(_LIKELY)
    return tuple(robot_from(replace(one, values={**shared, **one.values})) for one in arms)


def likely_tables(tables: Mapping[str, Any], arms: Iterable[Robot]) -> list[dict[str, Any]]:
    """Tables of likely arms: only the differences from the identified arm's table [robot]."""
    every = (robot_table(arm) for arm in arms)
    return [{key: one[key] for key in _LIKELY if key in one and one[key] != tables.get(key)} for one in every]


def _source(table: Table) -> RobotSource:
    """Source of the robot of a table."""
    given, folder = [key for key in _SOURCES if key in table.values], Path(table.path).parent
    if len(given) > 1:
        raise table.error(given[1], f"[robot] has {' and '.join(given)}; give one of them")
    if not given:
        raise table.error("name", "there is no robot; write [robot] and name = 'panda', or a file")
    key = given[0]
    value = table.values[key]
    if key == "spec":
        own = _inner(table, "spec", tuple(field.name for field in fields(ArmSpec)))
        links, numbers = own.get("links"), [field.name for field in fields(LinkSpec)]
        if not isinstance(links, list) or not all(
            isinstance(one, dict) and sorted(one) == sorted(numbers) for one in links
        ):
            raise table.error(
                "spec", f"links of spec is {shown(links)}; it is a list of tables of {', '.join(numbers)}"
            )
        with table.at("spec"):
            return RobotSource.of_spec(
                ArmSpec(**{"name": "arm", **own, "links": tuple(LinkSpec(**one) for one in links)})
            )
    if not isinstance(value, str) or not value:
        raise table.error(key, f"{key} of the robot is {shown(value)}; write [robot] and name = 'panda', or a file")
    if key == "name":
        with table.at("name"):
            return RobotSource.inside(value, folder)
    return RobotSource(format="urdf" if key == "urdf" else "mjcf", name=f"{key} of {table.path}", text=value)


def _inner(table: Table, key: str, known: tuple[str, ...] | None = None) -> Mapping[str, Any]:
    """Values of an inner table; known: its allowed keys; None: any."""
    if not isinstance(value := table.values[key], dict):
        example = "{ mass = 0.5 }" if key == "payload" else "{ name = value }"
        raise table.error(key, f"{key} is {shown(value)}; it is a table, such as {example}")
    if known is not None:
        table.table(key).only(known)
    return value


def _written_source(origin: RobotSource, folder: str | os.PathLike[str] | None) -> dict[str, Any]:
    """Keys that name the source of a robot."""
    if origin.spec is not None:
        name = next((name for name in PLANAR_ARMS if origin.spec == ArmSpec.paper(name)), None)
        return {"spec": asdict(origin.spec)} if name is None else {"name": name}
    if origin.format == "library":
        return {"name": origin.name}
    if origin.file is None:
        return {origin.format: origin.text}
    place = Path(os.path.realpath(origin.file))
    if folder is not None and place.is_relative_to(home := Path(os.path.realpath(folder))):
        return {"name": place.relative_to(home).as_posix()}
    if origin.format == "urdf":
        return {"urdf": read_urdf(origin.file)}
    return {"mjcf": ElementTree.tostring(read_mjcf(origin.file), "unicode")}  # with its includes
