"""Checks of a scene: its obstacles, and the names that may touch."""

from collections.abc import Sequence
from dataclasses import replace
from itertools import count
from typing import Any

import pinocchio as pin

from armdyn.arguments import number, several, shown
from armdyn.errors import ProblemError, did_you_mean
from armdyn.models.robots.robot import Robot
from armdyn.models.scene.obstacles import Obstacle


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
