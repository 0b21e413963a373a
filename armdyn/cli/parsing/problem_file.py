"""Problem files: a minimum-time problem in TOML, by the names that it has in Python. docs/problem_files.md says how."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import armdyn as ad
from armdyn.arguments import shown
from armdyn.cli.options.path_limits import limits_of
from armdyn.cli.options.robot import PartOptions
from armdyn.cli.parsing.positions import degrees_are_on
from armdyn.errors import ProblemError
from armdyn.models.robots.descriptions import is_description

if TYPE_CHECKING:
    from armdyn.parsing.toml import Table

TABLES = ("robot", "problem", "options")
ROBOT = (
    "name", "lock", "arm", "payload", "effort_limit", "velocity_limit", "armature", "damping", "friction",
    "friction_width", "passive",
)  # fmt: skip
PROBLEM = (
    "q_start", "q_goal", "v_start", "v_goal", "effort_limit", "velocity_limit", "position_limit", "reserve",
    "velocity_reserve", "passive", "effort_weight", "relative_effort_weight", "wrap", "goal_pose", "via",
    "obstacles", "self_collision", "clearance", "acceleration_limit", "jerk_limit", "path_constraints",
)  # fmt: skip
OPTIONS = ("effort", "starts", "time_limit", "max_intervals", "seed", "smooth")

_WORDS = {
    "start": "q_start",
    "goal": "q_goal",
    "via": "via",
    "goal pose": "goal_pose",
    "obstacle": "obstacles",
    "--limit": "path_constraints",
    "payload": "payload",
    "--lock": "lock",
    "no robot": "name",
}
"""What messages say of keys besides their names."""


@dataclass(frozen=True)
class Posed:
    """What a file asks for.

    Attributes:
        name: of the robot, as the file has it.
        problem: to be solved.
        options: of the solver, by name.
        carrying: the robot with another mass of its payload [kg]; None: with its own.
        loaded: the problem with another mass.
    """

    name: str
    problem: ad.MinimumTimeProblem
    options: Mapping[str, Any]
    carrying: Callable[[float | None], ad.Robot]
    loaded: Callable[[float], ad.MinimumTimeProblem]


def is_problem_file(name: str) -> bool:
    """Whether what stands for a robot is a problem file."""
    return name.lower().endswith(".toml")


def is_study_file(name: str) -> bool:
    """Whether a TOML file is a study's, or nothing that one could tell, rather than a problem's.

    Raises:
        ArmdynError: it cannot be read.
    """
    from armdyn.parsing.toml import read_toml

    return not {"robot", "problem"} & read_toml(name).values.keys()


def problem_of(name: str) -> Posed:
    """What a file asks for.

    Raises:
        ProblemError: it cannot be read, or asks for what there is not; with the line.
    """
    if degrees_are_on():
        raise ProblemError(f"--degrees: {name} says units itself: 1.57, or '90deg'")
    from armdyn.parsing.toml import read_toml  # who types a problem out does not wait for it

    file = read_toml(name)
    if "arms" in file.values:
        raise file.error("arms", f"[arms] is of a study file, whose cases armdyn sweep {name} does")
    file.only(TABLES)
    robot, problem, options = (file.table(table) for table in TABLES)
    for table, known in zip((robot, problem, options), (ROBOT, PROBLEM, OPTIONS), strict=True):
        table.only(known)
    with robot.telling(_WORDS):
        carrying = partial(_robot, robot, _robot_name(robot))
        arm = carrying(None)

    def loaded(mass: float) -> ad.MinimumTimeProblem:
        return _problem(problem, carrying(mass))

    posed = _problem(problem, arm)
    with options.telling():
        ad.MinimumTimeOptions(**options.values)
    return Posed(Path(name).stem, posed, options.values, carrying, loaded)


def refuse_beside_a_file(name: str, *groups: Any) -> None:
    """Refuse options that say what a problem file says.

    Args:
        name: the file.
        groups: of such options, as they were given.

    Raises:
        ProblemError: one of them is not as by default.
    """
    for group in groups:
        for field in fields(group):
            value = getattr(group, field.name)
            if is_dataclass(value):
                refuse_beside_a_file(name, value)
            elif field.default is not MISSING and value != field.default:
                option = "arm" if field.name == "part" else field.name.replace("_", "-")
                raise ProblemError(f"--{option}: {name} says what the problem is; write it there")


def _robot_name(table: Table) -> str:
    """The robot's name; or its file's path, which is inside the folder of the problem file.

    Raises:
        ProblemError: there is none, it is elsewhere, or is to be fetched from the internet.
    """
    name = table.values.get("name")
    if not isinstance(name, str) or not name:
        raise table.error("name", f"name of the robot is {shown(name)}; write [robot] and name = 'panda', or a file")
    if is_description(name):
        raise table.error("name", f"{shown(name)} is fetched from the internet, which a problem file does not do")
    home = Path(os.path.realpath(Path(table.path).parent))
    try:
        file = Path(os.path.realpath(home / name))
        is_file = bool(Path(name).suffix) or file.is_file()
    except (OSError, ValueError):  # a null character, a loop of links
        raise table.error("name", f"{shown(name)} is no path of a file") from None
    if not is_file:
        return name
    if not file.is_relative_to(home):
        raise table.error("name", f"{shown(name)} is outside the folder {home}: a problem file's robot is inside")
    return str(file)


def _robot(table: Table, name: str, mass: float | None) -> ad.Robot:
    """The robot, with what the table says of it; but for the payload's mass [kg] if there is another."""
    from armdyn.models.robots.poses import position_of

    given = table.values
    payload = given.get("payload")
    load = {} if payload is None else _named(table, "payload", ("mass", "com", "inertia", "frame"))
    load = load if mass is None else {**load, "mass": mass} if mass else {}
    carried = ad.Payload(**load) if load else None
    lock = {} if "lock" not in given else _named(table, "lock", None)
    ends = given.get("arm")
    if ends is not None and not (isinstance(ends, list) and len(ends) == 2 and all(isinstance(e, str) for e in ends)):
        raise table.error("arm", f"arm is {shown(ends)}; it is two joints or links: ['first', 'last']")
    locks = [f"{joint}={position_of(value, 'lock')!r}" for joint, value in lock.items()]
    robot = PartOptions(lock=locks or None, part=None if ends is None else ",".join(ends)).read(name, carried)
    robot = robot.with_limits(given.get("effort_limit"), given.get("velocity_limit"))
    robot = robot.with_armature(given.get("armature")).with_friction(
        given.get("damping"), given.get("friction"), given.get("friction_width")
    )
    return robot.with_passive(given.get("passive", ()))


def _problem(table: Table, robot: ad.Robot) -> ad.MinimumTimeProblem:
    with table.telling(_WORDS):
        return ad.MinimumTimeProblem(robot, **_asked(table, robot))


def _asked(table: Table, robot: ad.Robot) -> dict[str, Any]:
    """The arguments of a `MinimumTimeProblem`."""
    from armdyn.models.robots.poses import positions_of
    from armdyn.models.scene.obstacles import obstacle_from, pose_of

    asked = dict(table.values)
    for key in ("q_start", "q_goal"):
        if key in asked:
            asked[key] = positions_of(robot, asked[key], key)
    if "q_start" not in asked:
        raise table.error("", f"[problem] has no q_start: {robot.nv} positions of {', '.join(robot.joint_names)}")
    for key in ("via", "obstacles", "path_constraints"):
        if key in asked and not isinstance(asked[key], list):
            raise table.error(key, f"{key} is {shown(asked[key])}; it must be a list")
    if "via" in asked:
        asked["via"] = [positions_of(robot, q, "via") for q in asked["via"]]
    if "obstacles" in asked:
        asked["obstacles"] = [obstacle_from(one, f"obstacle {i + 1}") for i, one in enumerate(asked["obstacles"])]
    if "path_constraints" in asked:
        texts = asked["path_constraints"]
        if not all(isinstance(text, str) for text in texts):
            raise table.error(
                "path_constraints", f"path_constraints is {shown(texts)}; they are texts such as 'tip-speed=0.25'"
            )
        asked["path_constraints"] = limits_of(texts)
    if "goal_pose" in asked:
        pose = _named(table, "goal_pose", ("frame", "position", "quaternion", "rpy"))
        at = pose.get("position", ())
        turned = "quaternion" in pose or "rpy" in pose
        placed = pose_of(at, pose.get("quaternion"), pose.get("rpy"), "goal_pose") if turned else at
        asked["goal_pose"] = ad.GoalPose(pose.get("frame", robot.tip), placed)
    return asked


def _named(table: Table, key: str, known: tuple[str, ...] | None) -> dict[str, Any]:
    """A table within a table, of keys that are known; None: of any."""
    value = table.values[key]
    if not isinstance(value, dict):
        example = "{ mass = 0.5 }" if key == "payload" else "{ name = value }"
        raise table.error(key, f"{key} is {shown(value)}; it is a table, such as {example}")
    if known is not None:
        table.table(key).only(known)
    return value
