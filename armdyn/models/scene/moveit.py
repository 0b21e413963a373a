"""MoveIt's planning scenes: messages in YAML, and the text format of RViz (.scene)."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations, zip_longest
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from armdyn.arguments import shown
from armdyn.arrays import Array
from armdyn.errors import ProblemError, reraised
from armdyn.files import read_bounded
from armdyn.models.scene.mesh import Mesh, grouped
from armdyn.models.scene.shapes import Obstacle, Plane, primitive
from armdyn.models.values.placement import pose_of
from armdyn.parsing.numbers import to_number
from armdyn.parsing.yaml_text import MAX_BYTES, read_yaml

Read = tuple[tuple[Obstacle, ...], tuple[tuple[str, str], ...]]
"""Obstacles, and pairs of names that may touch."""

_KINDS = {"1": "box", "2": "sphere", "3": "cylinder", "4": "cone"}
"""Numbers of shape_msgs/SolidPrimitive."""
_ADD = ("", "0", "\0", "ADD")
_MOST_OBJECTS = 2000
_MOST_NAMES = 500


def read_planning_scene(file: Path, frames: Mapping[str, pin.SE3 | None]) -> Read:
    """The collision objects of a moveit_msgs/PlanningScene, and its allowed collision matrix.

    Args:
        file: YAML, as `ros2 topic echo`, MotionBenchMaker and Robowflex write it.
        frames: placements in the world of frames that objects may be in, besides "world" and those that the file
            places in it; None: the frame moves.

    Raises:
        ArmdynError: the file is no such message, or has elements that armdyn does not support.
    """
    content = read_yaml(file)
    scene = _table(content, "a planning scene") if content else {}
    world = _table(scene.get("world") or scene, "world")  # a PlanningSceneWorld alone
    if "collision_objects" not in world:
        raise ProblemError("no planning scene of MoveIt: it has no world with collision_objects")
    _refuse(scene, world)
    places = dict(frames) | _transforms(scene)
    objects = _list(world["collision_objects"], "collision_objects", _MOST_OBJECTS)
    obstacles = tuple(_object(one, places, f"collision_objects[{i}]") for i, one in enumerate(objects))
    names = [one.name for one in obstacles]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise ProblemError(f"two objects are called {shown(twice)}")
    return obstacles, _allowed(scene.get("allowed_collision_matrix"), [*names, *frames])


def _refuse(scene: Mapping[str, Any], world: Mapping[str, Any]) -> None:
    """Raise if a scene has parts that would be ignored."""
    octomap = world.get("octomap") or {}
    if _table(_table(octomap, "octomap").get("octomap") or octomap, "octomap").get("data"):
        raise ProblemError("world.octomap has data, which is not read: give its points as a PointCloud")
    state = _table(scene.get("robot_state") or {}, "robot_state")
    attached = _list(state.get("attached_collision_objects"), "attached_collision_objects", _MOST_OBJECTS)
    if attached:
        one = _table(attached[0], "an attached object")
        name, link = _table(one.get("object") or {}, "object").get("id"), one.get("link_name")
        raise ProblemError(f"{shown(name)} is attached to {shown(link)}: it is no obstacle but the robot's payload")
    placed = _table(state.get("multi_dof_joint_state") or {}, "multi_dof_joint_state")
    for transform in _list(placed.get("transforms"), "transforms", _MOST_NAMES):
        if not np.allclose(_pose(transform, "the robot's transform"), np.eye(4), rtol=0, atol=1e-9):
            raise ProblemError(
                "robot_state.multi_dof_joint_state places the robot elsewhere than at the origin of the world"
            )


def _transforms(scene: Mapping[str, Any]) -> dict[str, pin.SE3 | None]:
    """Frames that the file places in the world."""
    found: dict[str, pin.SE3 | None] = {"world": pin.SE3.Identity(), "": pin.SE3.Identity()}
    for one in _list(scene.get("fixed_frame_transforms"), "fixed_frame_transforms", _MOST_NAMES):
        name = str(_table(one, "a transform").get("child_frame_id", "")).strip("/")
        found[name] = pin.SE3(_pose(one.get("transform"), f"transform of {shown(name)}"))
    return found


def _object(given: Any, frames: Mapping[str, pin.SE3 | None], where: str) -> Obstacle:
    """Obstacles of a moveit_msgs/CollisionObject."""
    one = _table(given, where)
    name = one.get("id")
    if not isinstance(name, str) or not 0 < len(name) <= 200:
        raise ProblemError(f"{where}: its id is {shown(name)}; it must be a name")
    with reraised(ProblemError, f"object {name!r}"):
        if str(one.get("operation", "")) not in _ADD:
            raise ProblemError(f"its operation is {shown(one['operation'])}; objects of a scene are added (0)")
        frame = str(_table(one.get("header") or {}, "header").get("frame_id", "")).strip("/")
        if (placement := frames.get(frame)) is None:
            why = "moves" if frame in frames else "has no pose in the file; load_scene(path, robot) has its links'"
            raise ProblemError(f"its frame {shown(frame)} {why}")
        pose = placement.homogeneous @ _pose(one.get("pose"), "pose")
        pieces = list(_pieces(one, pose, name))
        if not pieces:
            raise ProblemError("it has no primitives, meshes or planes")
        return grouped(pieces, name)


def _pieces(one: Mapping[str, Any], pose: Array, name: str) -> Iterator[Obstacle]:
    """The shapes of an object, each placed in the object's own frame."""
    readers: dict[str, tuple[str, Callable[[Any, Array, str], Obstacle]]] = {
        "primitives": ("primitive_poses", _primitive),
        "meshes": ("mesh_poses", _mesh),
        "planes": ("plane_poses", _plane),
    }
    for key, (key_of_poses, read) in readers.items():
        shapes, poses = (_list(one.get(part), part, _MOST_OBJECTS) for part in (key, key_of_poses))
        if poses and len(poses) != len(shapes):
            raise ProblemError(f"{len(shapes)} {key} and {len(poses)} {key_of_poses}; there must be as many")
        for i, (shape, at) in enumerate(zip_longest(shapes, poses)):
            yield read(_table(shape, f"{key}[{i}]"), pose @ _pose(at, f"{key_of_poses}[{i}]"), name)


def _primitive(shape: Mapping[str, Any], pose: Array, name: str) -> Obstacle:
    kind = str(shape.get("type")).lower()
    kind, sizes = _KINDS.get(kind, kind), _numbers(shape.get("dimensions"), "dimensions")
    if kind == "cone" and sizes.shape == (2,):
        height, radius = sizes
        turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
        outside = radius / np.cos(np.pi / 64)  # a pyramid that contains the cone, 0.1 % larger
        base = np.column_stack([outside * np.cos(turn), outside * np.sin(turn), np.full(64, -height / 2)])
        return Mesh([np.vstack([base, [[0, 0, height / 2]]])], pose, name=name)
    return primitive(kind, sizes, pose, name)


def _mesh(shape: Mapping[str, Any], pose: Array, name: str) -> Obstacle:
    vertices = [_numbers(one, "a vertex") for one in _list(shape.get("vertices"), "vertices")]
    given = _list(shape.get("triangles"), "triangles")
    indices = (one.get("vertex_indices") if isinstance(one, Mapping) else one for one in given)
    triangles = [_numbers(one, "a triangle's vertex_indices") for one in indices]
    return Mesh.from_triangles(_rows(vertices), _rows(triangles), pose, name=name)


def _plane(shape: Mapping[str, Any], pose: Array, name: str) -> Obstacle:
    """The half space behind a plane a x + b y + c z + d = 0."""
    coefficients = _numbers(shape.get("coef"), "coef")
    if coefficients.shape != (4,) or not np.any(coefficients[:3]):
        raise ProblemError(f"coef of its plane is {shown(shape.get('coef'))}; it must be a, b, c, d, not a = b = c = 0")
    normal, d = coefficients[:3], coefficients[3]
    point = -d / float(normal @ normal) * normal
    at, outward = (tuple(one.tolist()) for one in (pose[:3, :3] @ point + pose[:3, 3], pose[:3, :3] @ normal))
    return Plane(at, outward, name=name)


def _allowed(matrix: Any, names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Pairs that a moveit_msgs/AllowedCollisionMatrix allows to touch; its defaults hold for pairs without an entry."""
    if not matrix:
        return ()
    known = _table(matrix, "allowed_collision_matrix")
    own = [str(name) for name in _list(known.get("entry_names"), "entry_names", _MOST_NAMES)]
    given = _list(known.get("entry_values"), "entry_values")
    rows: list[Any] = [row.get("enabled") if isinstance(row, Mapping) else row for row in given]
    if len(rows) != len(own) or any(not isinstance(row, list) or len(row) != len(own) for row in rows):
        raise ProblemError(
            f"allowed_collision_matrix: entry_values must be {len(own)} rows of {len(own)}, as entry_names"
        )
    entries = {frozenset((a, b)): _flag(rows[i][j]) for (i, a), (j, b) in combinations(enumerate(own), 2)}
    keys = ("default_entry_names", "default_entry_values")
    defaults = (_list(known.get(key), key, _MOST_NAMES) for key in keys)
    usual = {str(name): _flag(value) for name, value in zip_longest(*defaults)}
    everything = list(dict.fromkeys([*own, *names]))
    for name in usual:
        for other in everything:
            both = [usual[each] for each in (name, other) if each in usual]
            entries.setdefault(frozenset((name, other)), all(both))
    return tuple(tuple(sorted(pair)) for pair, may in entries.items() if may and len(pair) == 2)  # type: ignore[misc]


def _flag(value: Any) -> bool:
    if str(value).lower() not in ("true", "false", "0", "1"):
        raise ProblemError(f"allowed_collision_matrix has {shown(value)}; its values are true or false")
    return str(value).lower() in ("true", "1")


def _table(value: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise ProblemError(f"{what} is {shown(value)}; it must be a table")
    return value


def _list(value: Any, what: str, most: int | None = None) -> list[Any]:
    """A list; an empty one where there is none."""
    if value in (None, "", {}):
        return []
    if not isinstance(value, list) or (most is not None and len(value) > most):
        raise ProblemError(f"{what} is {shown(value)}; it must be a list{f' of at most {most}' if most else ''}")
    return value


def _numbers(value: Any, what: str) -> Array:
    """Parse finite numbers, shape (n,), from a list or from a mapping with x, y, z and perhaps w."""
    keys = "xyzw" if isinstance(value, Mapping) and "w" in value else "xyz"
    members = [value.get(key, 0) for key in keys] if isinstance(value, Mapping) else value
    try:
        found = np.array([to_number(str(one)) for one in members])
    except (TypeError, ValueError):
        raise ProblemError(f"{what} is {shown(value)}; it must be numbers") from None
    if not np.all(np.isfinite(found)):
        raise ProblemError(f"{what} is {shown(value)}; it must be finite")
    return found


def _rows(rows: Sequence[Array]) -> Array:
    """Rows of three numbers, shape (n, 3)."""
    if any(row.shape != (3,) for row in rows):
        raise ProblemError("a vertex or triangle of its mesh has no three numbers")
    return np.array(rows).reshape(-1, 3)


def _pose(value: Any, what: str) -> Array:
    """A geometry_msgs/Pose or Transform, shape (4, 4) [m]; none is the identity, and so is an empty quaternion."""
    given = _table(value or {}, what)
    position = given.get("position", given.get("translation"))
    turned = given.get("orientation", given.get("rotation"))
    quaternion = np.array([0.0, 0, 0, 1]) if not turned else _numbers(turned, f"orientation of {what}")
    at = np.zeros(3) if not position else _numbers(position, f"position of {what}")
    return pose_of(at, quaternion if np.any(quaternion) else [0, 0, 0, 1], None, what)


def read_scene_text(file: Path, frames: Mapping[str, pin.SE3 | None]) -> Read:
    """The objects of a file of MoveIt's text format, old or new; it has no frames and no allowed contacts.

    Raises:
        ArmdynError: the file cannot be read, or is not of this format.
    """
    lines = [line.strip() for line in read_bounded(file, MAX_BYTES).decode("utf-8", "replace").splitlines()]
    starts = [i for i, line in enumerate(lines) if line.startswith("*")]
    if not starts or len(starts) > _MOST_OBJECTS or "." not in lines[starts[-1] :]:
        raise ProblemError("no scene of MoveIt: objects begin with '* name', and '.' ends the file")
    end = lines.index(".", starts[-1])
    objects = [_text_object(lines[start:stop]) for start, stop in zip(starts, [*starts[1:], end], strict=True)]
    place = {"": pin.SE3.Identity()}
    return tuple(_object(one, place, f"object {i}") for i, one in enumerate(objects)), ()


def _text_object(lines: Sequence[str]) -> dict[str, Any]:
    """The lines of an object as a message."""
    words = iter(word for line in lines[1:] for word in line.split())
    take: Callable[[int], list[str]] = lambda n: [next(words) for _ in range(n)]  # noqa: E731
    pose: Callable[[], dict[str, Any]] = lambda: {"position": take(3), "orientation": take(4)}  # noqa: E731
    found: dict[str, Any] = {"id": lines[0][1:].strip(), "primitives": [], "primitive_poses": []}
    found |= {"meshes": [], "mesh_poses": [], "planes": [], "plane_poses": []}
    try:
        if len(lines[1].split()) > 1:  # the new format: the object has a pose
            found["pose"] = pose()
        for _ in range(min(int(next(words)), _MOST_OBJECTS)):
            kind = next(words)
            if kind == "mesh":
                count, triangles = (min(int(number), MAX_BYTES) for number in take(2))
                points = [take(3) for _ in range(count)]
                found["meshes"].append({"vertices": points, "triangles": [take(3) for _ in range(triangles)]})
            elif kind == "plane":
                found["planes"].append({"coef": take(4)})
            else:
                sizes = take({"box": 3, "sphere": 1}.get(kind, 2))
                sizes = sizes[::-1] if kind in ("cylinder", "cone") else sizes  # there the radius comes first
                found["primitives"].append({"type": kind, "dimensions": sizes})
            found[{"mesh": "mesh_poses", "plane": "plane_poses"}.get(kind, "primitive_poses")].append(pose())
            take(4)  # its colour
    except (StopIteration, RuntimeError, ValueError, IndexError):
        raise ProblemError(f"object {found['id']!r} is incomplete") from None
    return found
