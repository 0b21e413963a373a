"""Payloads and tools as files describe them, with their shapes."""

import os
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from armdyn.arguments import shown
from armdyn.errors import ProblemError
from armdyn.models.scene.obstacles import Obstacle, obstacle_entry, obstacle_from
from armdyn.models.values.placement import pose_entry, pose_of
from armdyn.models.values.spec import Payload, Tool

PAYLOAD_KEYS = ("mass", "com", "inertia", "frame", "name", "shapes")
_TIP = ("tip", "quaternion", "rpy")
TOOL_KEYS = (*PAYLOAD_KEYS, *_TIP)


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
    entry: dict[str, Any] = {"mass": body.mass, "com": list(body.com), "inertia": list(body.inertia)}
    entry |= {} if body.frame is None else {"frame": body.frame}
    entry |= {} if body.name == "payload" else {"name": body.name}
    if shapes := [obstacle_entry(shape) for shape in body.shapes if isinstance(shape, Obstacle)]:
        entry["shapes"] = shapes
    if isinstance(body, Tool):
        pose = pose_entry(np.array(body.tip), turned=True)
        entry |= {"tip": pose["position"], "quaternion": pose["quaternion"]}
    return entry
