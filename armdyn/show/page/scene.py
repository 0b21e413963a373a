"""Scene of a page as data: shapes as meshcat's commands, joint poses per frame. `assets/scene.js` draws it."""

import base64
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import takewhile
from typing import Any

import numpy as np
import pinocchio as pin
import umsgpack  # type: ignore[import-untyped]
from meshcat import geometry as mg

from armdyn.arguments import number, shown
from armdyn.arrays import Array
from armdyn.errors import ProblemError, TrajectoryError
from armdyn.models import Robot
from armdyn.models.scene.obstacles import Obstacle
from armdyn.show.page.cycle import CarriedPart, ShownPart, shown_parts
from armdyn.show.page.facts import Facts
from armdyn.show.visuals import VisualShape, obstacle_shapes, robot_shapes
from armdyn.trajectory import Trajectory

COLORS = ((0.86, 0.20, 0.27), (0.13, 0.45, 0.80), (0.14, 0.62, 0.40), (0.52, 0.32, 0.68), (0.90, 0.55, 0.10))
"""One per trajectory."""

WATCHABLE = 4.0
"""Playing time of a replay by default [s]."""

_TOUCHING = (0.90, 0.10, 0.12)
"""Colour of bodies that touch."""
_SEEN_THROUGH = 0.75
"""Least opacity of them [-]."""
_SPEEDS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
LARGEST = 1e12
_MAX_FRAMES = 4000
_MAX_TRAIL = 1200


def scene_data(
    robot: Robot,
    trajectories: Sequence[Trajectory],
    *,
    fps: float = 60,
    slow_motion: float | None = None,
    obstacles: Sequence[Obstacle] = (),
    touching: Collection[str] = (),
    marks: Sequence[Mapping[str, Any]] = (),
    parts: Sequence[CarriedPart] = (),
) -> dict[str, Any]:
    """Input of `assets/scene.js`, ready for JSON.

    Args:
        robot: the arm that moves.
        trajectories: one or more motions of its joints; they start together.
        fps: frames per second of playing time that are stored; the page interpolates between them.
        slow_motion: initial playing time over real time; None: about 4 s in all.
        obstacles: drawn where they stand.
        touching: names of links, tool, payload and obstacles that are drawn in red.
        marks: see `mark_of`.
        parts: that the first trajectory grasps and releases; drawn instead of the robot's payload.

    Raises:
        TrajectoryError: one has a number beyond `LARGEST`.
        ProblemError: `fps` is not from 1e-3 to 1e3, or `slow_motion` not from 1e-6 to 1e6.
    """
    _expect_shown(trajectories)
    for name, value, most in (("fps", fps, 1e3), ("slow_motion", slow_motion, 1e6)):
        if value is not None and not 1 / most <= number(value, name) <= most:
            raise ProblemError(f"{name} is {shown(value)}; it must be from {1 / most:g} to {most:g}")
    durations = [trajectory.duration for trajectory in trajectories]
    speed = playing_speed(durations) if slow_motion is None else 1.0 / slow_motion
    step = min(speed, min(durations) / WATCHABLE) / fps
    held = robot.payload.name if parts and robot.payload else None
    arm = [one for one in robot_shapes(robot) if one.name != held]
    named = {f"shape{i}": one for i, one in enumerate(arm)}
    named |= {f"obstacle{i}": one for i, one in enumerate(obstacle_shapes(obstacles))}
    shapes = {name: _red(one) if one.name in touching else one for name, one in named.items()}
    return {
        "joints": robot.nv,
        # Of every frame its name, its joint, and its origin in that joint's frame [m].
        "points": [(one.name, int(one.parentJoint), one.placement.translation.tolist()) for one in robot.model.frames],
        "tip": robot.tip,
        "planar": is_planar(robot),
        "reach": reach_of(robot, np.concatenate([trajectory.q for trajectory in trajectories])),
        "speed": speed,
        "commands": [command for name, one in shapes.items() for command in _commands(name, one)],
        "marks": list(marks),
        "parts": [_part(k, part) for k, part in enumerate(shown_parts(robot, trajectories[0], parts))],
        "arms": [_arm(robot, i, trajectory, step) for i, trajectory in enumerate(trajectories)],
    }


def _expect_shown(trajectories: Sequence[Trajectory]) -> None:
    for trajectory in trajectories:
        if (most := max(np.max(np.abs(x)) for x in (trajectory.t, *trajectory(trajectory.t)))) > LARGEST:
            raise TrajectoryError(f"a trajectory has the number {most:g}; beyond {LARGEST:g} nothing can be shown")


def mark_of(clearance: Facts, always: bool = False) -> dict[str, Any] | None:
    """A line between the nearest points of two bodies with their distance; None: the facts do not have the points.

    Args:
        clearance: facts of a `Clearance`.
        always: it is shown at all times; else about its own.
    """
    distance, points = clearance.number("distance"), clearance.values.get("points")
    ends = [Facts({"end": end}).numbers("end") for end in points] if isinstance(points, list | tuple) else []
    if distance is None or len(ends) != 2 or any(len(end) != 3 or None in end for end in ends):
        return None
    label = f"{abs(1e3 * distance):.1f} mm{' inside' if distance < 0 else ''}"
    return {"time": None if always else clearance.number("time"), "points": ends, "label": label}


def _red(shape: VisualShape) -> VisualShape:
    return replace(shape, rgba=(*_TOUCHING, max(shape.rgba[3], _SEEN_THROUGH)))


def short_names(names: Sequence[str]) -> list[str]:
    """Joints' names without their common beginning: panda_joint1 and panda_joint2 are joint1 and joint2."""
    same = takewhile(lambda letters: len(set(letters)) == 1, zip(*names, strict=False))  # as far as the shortest goes
    stem = "".join(letters[0] for letters in same).rfind("_") + 1 if len(names) > 1 else 0
    return [name[stem:].removesuffix("_joint") or name for name in names]


def playing_speed(durations: Sequence[float]) -> float:
    """Seconds of motion per second of playing, a round number of at most 1; of several by their mean duration."""
    factor = float(np.sqrt(min(durations) * max(durations))) / WATCHABLE
    return min((s for s in _SPEEDS if s <= 1.0), key=lambda s: abs(np.log(s / factor)))


def packed(array: Array, kind: str = "<f4") -> str:
    """Numbers in base64, as floats of 32 bits or of another kind."""
    return base64.b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode("ascii")


def _commands(name: str, shape: VisualShape) -> list[str]:
    """Commands for one shape; identifiers are its path, so that equal input gives equal bytes."""
    path = f"/armdyn/arm0/joint{shape.joint}/{name}"
    r, g, b, a = (round(255 * x) for x in shape.rgba)
    material = mg.MeshPhongMaterial(color=(r << 16) + (g << 8) + b, opacity=a / 255, shininess=45, specular=0x303030)
    mesh = mg.Mesh(shape.geometry, material)
    shape.geometry.uuid, material.uuid, mesh.uuid = f"{path}#geometry", f"{path}#material", f"{path}#mesh"
    commands = (
        {"type": "set_object", "path": path, "object": mesh.lower()},
        {"type": "set_transform", "path": path, "matrix": shape.placement.T.ravel().tolist()},
    )
    return [base64.b64encode(umsgpack.packb(one)).decode("ascii") for one in commands]


def _part(k: int, part: ShownPart) -> dict[str, Any]:
    """A carried part: its shapes in the scene, and when they are shown."""
    names = [(f"joint{one.joint}", f"part{k}-{i}") for i, one in enumerate(part.shapes)]
    commands = [one for (_, name), shape in zip(names, part.shapes, strict=True) for one in _commands(name, shape)]
    return {"shapes": names, "commands": commands, "begin": part.begin, "end": part.end}


def _arm(robot: Robot, i: int, trajectory: Trajectory, step: float) -> dict[str, Any]:
    """Joint poses of one trajectory on a uniform grid of times, and the path of its tip."""
    n = int(np.clip(np.ceil(trajectory.duration / step) + 1, 2, _MAX_FRAMES))
    poses, tips = joint_poses(robot, trajectory(np.linspace(trajectory.t[0], trajectory.t[-1], n)).q)
    return {
        "duration": trajectory.duration,
        "color": list(COLORS[i % len(COLORS)]),
        "frames": n,
        "poses": packed(poses),
        "trail": packed(tips[np.r_[0 : n - 1 : -(-n // _MAX_TRAIL), n - 1]]),
    }


def joint_poses(robot: Robot, q: Array) -> tuple[Array, Array]:
    """Every joint's pose and the tip's position.

    Args:
        robot: of nv joints.
        q: joint coordinates [rad or m], shape (n, nv).

    Returns:
        Position [m] and quaternion (x, y, z, w), shape (n, nv, 7); the tip [m], shape (n, 3).
    """
    data = robot.model.createData()
    tip = robot.frame(robot.tip)
    poses, tips = np.empty((len(q), robot.nv, 7)), np.empty((len(q), 3))
    for k, angles in enumerate(q):
        pin.forwardKinematics(robot.model, data, robot.configuration(angles))
        poses[k] = [pin.SE3ToXYZQUAT(pose) for pose in list(data.oMi)[1:]]
        tips[k] = data.oMi[tip.parentJoint].act(tip.placement.translation)
    return poses, tips


def reach_of(robot: Robot, q: Array) -> float:
    """Upper bound of the distance from base to tip [m].

    Args:
        robot: the robot.
        q: joint positions that it takes [rad or m], shape (n, nv).
    """
    tip = robot.frame(robot.tip)
    steps = [*list(robot.model.jointPlacements)[1:], tip.placement]
    travel = float(np.max(np.abs(q[:, robot.slides]), axis=0).sum())
    return max(travel + sum(float(np.linalg.norm(step.translation)) for step in steps), 1e-3)


def is_planar(robot: Robot) -> bool:
    """Whether it moves in the world's x-z plane: every joint turns about y."""
    speeds = pin.computeJointJacobians(robot.model, robot.model.createData(), pin.neutral(robot.model))
    return bool(np.all(np.abs(speeds[[1, 3, 5]]) < 1e-9))
