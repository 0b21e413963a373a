"""Registry of obstacle shapes; obstacles, payloads and tools in JSON and TOML; checks of a scene."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from inspect import Parameter, signature
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from armdyn.arguments import number, several, shown
from armdyn.errors import ProblemError, did_you_mean, reraised
from armdyn.files import attributes, file_inside, read_json
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.mesh import Group, Mesh
from armdyn.models.scene.point_cloud import HeightMap, PointCloud
from armdyn.models.scene.shapes import Box, Capsule, Cylinder, Obstacle, Plane, Sphere
from armdyn.models.values.placement import pose_entry, pose_from, pose_of
from armdyn.models.values.spec import Payload, Tool

__all__ = [
    "SHAPES", "Box", "Capsule", "Cylinder", "Group", "HeightMap", "Mesh", "Obstacle", "Plane", "PointCloud", "Sphere",
    "load_obstacles", "obstacle_entry", "obstacle_from",
]  # fmt: skip

_MAX_FILE = 4 * 2**20
_LONGEST_NAME = 200

SHAPES: dict[str, type[Obstacle]] = {
    "sphere": Sphere,
    "capsule": Capsule,
    "cylinder": Cylinder,
    "box": Box,
    "plane": Plane,
    "mesh": Mesh,
    "group": Group,
    "point cloud": PointCloud,
    "height map": HeightMap,
}
"""All shapes, by the "type" that files have for them, and the word of --obstacle."""

_KEYS = {"path": "file", "placement": "position"}
"""Parameters of a shape that files call otherwise."""


PAYLOAD_KEYS = ("mass", "com", "inertia", "frame", "name", "shapes")
_TIP = ("tip", "quaternion", "rpy")
TOOL_KEYS = (*PAYLOAD_KEYS, *_TIP)


def obstacle_from(entry: Mapping[str, Any], where: str, folder: str | os.PathLike[str] | None = None) -> Obstacle:
    """An obstacle from a table of JSON or TOML, such as {"type": "box", "size": […], "position": […], "rpy": […]}.

    Args:
        entry: the keys of its constructor, or, with "file", of its `from_file`.
        where: the place in the file, in messages.
        folder: of the file that has the entry: a file that the entry names is inside; None: it may name none.

    Raises:
        ProblemError: an unknown type, or a number that is missing, superfluous or wrong.
    """
    kind = entry.get("type") if isinstance(entry, Mapping) else None
    if not isinstance(kind, str) or kind not in SHAPES:
        raise ProblemError(f'{where}: "type" is {shown(kind)}; it must be one of {", ".join(SHAPES)}')
    made: Any = SHAPES[kind]
    make = getattr(made, "from_file", made) if "file" in entry else made
    parameters = signature(make).parameters
    needed = {_KEYS.get(name, name) for name, one in parameters.items() if one.default is Parameter.empty}
    allowed = {_KEYS.get(name, name) for name in parameters} - needed
    allowed |= {"rpy", "quaternion"} if "placement" in parameters else set()
    given = set(entry) - {"type"}
    if needed - given or given - needed - allowed:
        raise ProblemError(
            f"{where}: a {kind} has {', '.join(sorted(needed))}, and may have {', '.join(sorted(allowed))}; "
            f"given: {shown(sorted(given)) if given else 'nothing'}"
        )
    name = str(entry.get("name", kind))
    if len(name) > _LONGEST_NAME:
        raise ProblemError(f"{where}: its name has {len(name)} characters; it may have {_LONGEST_NAME}")
    with reraised(ProblemError, where):
        arguments = {key: entry[key] for key in parameters if key in entry} | ({"name": name} if make is made else {})
        if given & {"position", "rpy", "quaternion"}:
            arguments["placement"] = pose_from(entry, f"obstacle {name!r}")
        if "file" in entry:
            if folder is None:
                raise ProblemError(f'"file" is {shown(entry["file"])}; a file of results names no others')
            arguments["path"] = str(file_inside(folder, entry["file"]))
        if made is Group:
            arguments["members"] = _members(entry["members"], folder)
        obstacle: Obstacle = make(**arguments)
    return obstacle


def _members(entries: object, folder: str | os.PathLike[str] | None) -> list[Obstacle]:
    """The members of a group."""
    if not isinstance(entries, Sequence) or isinstance(entries, str):
        raise ProblemError(f'"members" is {shown(entries)}; it must be a list of obstacles')
    if any(isinstance(one, Mapping) and one.get("type") == "group" for one in entries):
        raise ProblemError("a member is a group; groups have no groups")
    return [obstacle_from(one, f"member {i}", folder) for i, one in enumerate(entries, start=1)]


def obstacle_entry(obstacle: Obstacle) -> dict[str, Any]:
    """Entry of an obstacle for JSON and TOML files, the inverse of `obstacle_from`."""
    kinds = [kind for kind, made in SHAPES.items() if type(obstacle) is made]
    if not kinds:
        raise ProblemError(f"{type(obstacle).__name__} has no name for files: add it to `SHAPES`")
    entry: dict[str, Any] = {"type": kinds[0]}
    for field in fields(obstacle):  # type: ignore[arg-type]  # it is a dataclass
        value = getattr(obstacle, field.name)
        if field.name == "placement":
            pose = np.array(value)
            entry |= pose_entry(pose, turned=not np.array_equal(pose[:3, :3], np.eye(3)))
        else:
            entry[field.name] = _plain(value)
    return entry


def _plain(value: Any) -> Any:
    """A field's value as JSON has it."""
    if isinstance(value, Obstacle):
        return obstacle_entry(value)
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def load_obstacles(path: str | os.PathLike[str]) -> tuple[Obstacle, ...]:
    """Read obstacles from a JSON file: a list of entries of `obstacle_from`.

    Raises:
        ProblemError: the file cannot be read, or says something else.
    """
    with reraised(ProblemError, "no file of obstacles"):
        entries = read_json(path, _MAX_FILE)
    if not isinstance(entries, Sequence) or isinstance(entries, str) or not entries:
        raise ProblemError(f"{path}: must be a list of obstacles, each an object with a type")
    return tuple(
        obstacle_from(entry, f"{path}, obstacle {i}", Path(path).parent) for i, entry in enumerate(entries, start=1)
    )


def payload_from(entry: Mapping[str, Any], folder: str | os.PathLike[str] | None = None) -> Payload:
    """A payload from a table of TOML or JSON, such as {"mass": 0.5, "shapes": [{"type": "box", …}]}.

    Args:
        entry: its keys.
        folder: see `obstacle_from`.

    Raises:
        ProblemError: an entry of shapes is no shape.
        TypeError: a key is none of `PAYLOAD_KEYS`.
        SpecError: see `Payload`.
    """
    return Payload(**_arguments(entry, "payload", folder))


def tool_from(entry: Mapping[str, Any], folder: str | os.PathLike[str] | None = None) -> Tool:
    """A tool from a table of TOML or JSON: keys of a payload, and a tip, with quaternion or rpy if it is turned.

    Args:
        entry: its keys.
        folder: see `obstacle_from`.

    Raises:
        ProblemError: see `payload_from`.
        TypeError: a key is none of `TOOL_KEYS`.
        SpecError: see `Tool`.
    """
    given = _arguments(entry, "tool", folder)
    tip, quaternion, rpy = (given.pop(key, None) for key in _TIP)
    return Tool(tip=pose_of((0.0, 0.0, 0.0) if tip is None else tip, quaternion, rpy, "the tool's tip"), **given)


def _arguments(entry: Mapping[str, Any], what: str, folder: str | os.PathLike[str] | None) -> dict[str, Any]:
    """Arguments of a `Payload`, with its shapes as obstacles."""
    shapes = entry.get("shapes", ())
    if not isinstance(shapes, Sequence) or isinstance(shapes, str):
        raise ProblemError(f"shapes of the {what} is {shown(shapes)}; it must be a list of tables, each with a type")
    found = [obstacle_from(shape, f"shape {i} of the {what}", folder) for i, shape in enumerate(shapes, start=1)]
    return {"mass": 0.0, **entry, "shapes": found}


def payload_entry(body: Payload) -> dict[str, Any]:
    """Entry of a payload or tool for files, the inverse of `payload_from` and `tool_from`."""
    entry = attributes(body, "mass", "com", "inertia")
    entry |= {} if body.frame is None else {"frame": body.frame}
    entry |= {} if body.name == "payload" else {"name": body.name}
    if shapes := [obstacle_entry(shape) for shape in body.shapes if isinstance(shape, Obstacle)]:
        entry["shapes"] = shapes
    if isinstance(body, Tool):
        pose = pose_entry(np.array(body.tip), turned=True)
        entry |= {"tip": pose["position"], "quaternion": pose["quaternion"]}
    return entry


def check_scene(obstacles: Sequence[object], clearance: float) -> tuple[Obstacle, ...]:
    """The obstacles, those of one name numbered ("box", "box 2"); refuse other values, and no clearance."""
    number(clearance, "clearance", unit="m", sign="not negative")
    taken: set[str] = set()
    named: list[Obstacle] = []
    for i, obstacle in enumerate(obstacles):
        if not isinstance(obstacle, Obstacle):
            raise ProblemError(f"obstacles[{i}] is {shown(obstacle)}; it must be a Sphere, a Box or another obstacle")
        one: Any = obstacle  # a dataclass
        if obstacle.name in taken:
            others = {other.name for other in obstacles if isinstance(other, Obstacle)} | taken
            one = replace(one, name=next(name for k in count(2) if (name := f"{obstacle.name} {k}") not in others))
        taken.add(one.name)
        named.append(one)
    return tuple(named)


def contacts(pairs: object, what: str, robot: Robot, obstacles: Sequence[Obstacle]) -> tuple[tuple[str, str], ...]:
    """Pairs of names that may touch; refuse anything else, and names of no link and no obstacle."""
    found = []
    links = [frame.name for frame in robot.model.frames if frame.type == pin.FrameType.BODY]
    known = {*links, *(body.name for body in robot.attached), *(obstacle.name for obstacle in obstacles)}
    for i, pair in enumerate(several(pairs, what)):
        both = tuple(pair) if isinstance(pair, list | tuple) else ()
        if len(both) != 2 or not all(isinstance(name, str) for name in both):
            raise ProblemError(f"{what}[{i}] is {shown(pair)}; it must be two names of links or obstacles")
        for name in both:
            if name not in known:
                raise ProblemError(
                    f"{what}[{i}]: no link of {robot.name} and no obstacle is named {shown(name)}"
                    f"{did_you_mean(name, known)}"
                )
        found.append(both)
    return tuple(found)
