"""The command `armdyn robots`: lists the robots that have a name."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import armdyn as ad
from armdyn import models
from armdyn.cli.console import Answer, console, done, escape, facts_table, table, working
from armdyn.cli.invocation import option_value
from armdyn.cli.options.groups import argument, flag
from armdyn.cli.options.robot import PartOptions, known_names
from armdyn.errors import ArmdynError
from armdyn.reprs import joint_unit

Facts = dict[str, Any]

_LIMITS = ("position", "velocity", "effort")
_HEADS = ("name", ">dof", ">q", ">v", ">τ", ">locked", "remarks")
_MARKS, _PLAIN_MARKS = "●◐○", "*+-"
"""Of all joints, of some, of none; the latter for terminals that lack the former."""


def robots(
    name: str | None = argument(
        "ROBOT",
        "Its named poses, such as --q-start takes; none: all robots.",
        default=None,
        autocompletion=known_names,
    ),
    everything: bool = flag("Also the library's robots of several limbs, and those armdyn refuses.", name="--all"),
) -> Answer:
    """Robots by name: the paper's arms, benchmarks with joints without a motor, and example-robot-data's.

    Each name works wherever a command takes ROBOT, and in Robot.from_library(NAME). Everything of a robot that
    is not the arm is locked; armdyn doctor NAME says where.

    [dim]armdyn robots
    armdyn robots panda
    armdyn robots --all
    armdyn doctor baxter_left[/]
    """
    if name is not None:
        return _poses(PartOptions().read(name))
    from armdyn.models.robots.library import BENCHMARKS, LIBRARY_ARMS, other_robots

    with working("robots") as progress:
        arms = [_facts(name, progress) for name in (*models.PLANAR_ARMS, *BENCHMARKS, *LIBRARY_ARMS)]
        others = [_facts(name, progress) for name in other_robots()] if everything or option_value("json") else []
    titles = {"Arms by name": arms, "The library's other robots, base fixed and every joint free": others}
    tables = [table(title, _HEADS, map(_row, rows)) for title, rows in titles.items() if rows]
    every, some, none = _marks()
    legend = (
        f"\nLimits of position q, velocity v and torque τ: {every} of all joints, {some} of some, {none} of none. "
        "Minimum time needs torque limits: give missing ones with --effort-limit. armdyn doctor NAME shows "
        "every joint."
    )
    return done("listed", {"robots": arms, "others": others}, *tables, legend)


def _poses(robot: ad.Robot) -> Answer:
    """The poses of one robot."""
    poses = robot.poses
    listed = {name: q.tolist() for name, q in poses.items()}
    facts = {"robot": robot.name, "joints": list(robot.joint_names), "poses": listed}
    if not poses:
        return done("listed", facts, f"{escape(robot.name)} has no pose with a name: no SRDF is by its URDF")
    words = {name: ", ".join(f"{x:.4g}" for x in q) for name, q in poses.items()}
    joints, first = escape(", ".join(robot.joint_names)), escape(next(iter(poses)))
    more = f"\nPositions are those of {joints}.\n--q-start {first}, --q-goal and --via take these names."
    return done("listed", facts, facts_table(f"{robot.name}: poses [{joint_unit(robot.slides)}]", words), more)


def _facts(name: str, progress: Callable[[str], None]) -> Facts:
    """Facts of one robot; without exceptions, as one bad robot must not hide the others."""
    import numpy as np

    from armdyn.models.robots.library import LIBRARY_ARMS
    from armdyn.models.robots.source import RobotSource

    progress(name)
    arm = LIBRARY_ARMS.get(name)
    facts: Facts = {"name": name, "robot": name if arm is None else arm.robot, "loads": False, "reason": ""}
    try:
        robot = ad.Robot.from_source(RobotSource.named(name))
    except ArmdynError as error:
        return facts | {"reason": str(error).rsplit("/", 1)[-1]}  # without the folder, which is always the same
    except Exception as error:  # a damaged installation of the library, say
        return facts | {"reason": f"{type(error).__name__}: {error}"}
    limits = robot.limits
    given = {
        "position": np.isfinite(limits.position_lower) & np.isfinite(limits.position_upper),
        "velocity": np.isfinite(limits.velocity),
        "effort": np.isfinite(limits.effort_upper),
    }
    return facts | {
        "loads": True,
        "dof": robot.nv,
        "joints": list(robot.joint_names),
        "continuous": [joint for joint, i in zip(robot.joint_names, robot.model.nqs[1:], strict=True) if i == 2],
        "passive": list(robot.passive),
        "tip": robot.tip,
        "missing": {
            kind: [joint for joint, has in zip(robot.joint_names, present, strict=True) if not has]
            for kind, present in given.items()
        },
        "locked": dict(robot.locked),
    }


def _row(facts: Facts) -> list[str]:
    name = facts["name"]
    if not facts["loads"]:
        return [name, *[""] * 5, facts["reason"]]
    missing, joints = facts["missing"], facts["joints"]
    every, some, none = _marks()
    marks = [every if not missing[k] else none if len(missing[k]) == len(joints) else some for k in _LIMITS]
    remarks = [] if facts["robot"] == facts["name"] else [f"of {facts['robot']}"]
    if missing["effort"]:
        remarks.append(f"needs --effort-limit ({which(missing['effort'], joints)})")
    if facts["passive"]:
        remarks.append(f"no motor ({which(facts['passive'], joints)})")
    if facts["continuous"]:
        remarks.append(f"no end stops ({which(facts['continuous'], joints)})")
    return [name, str(facts["dof"]), *marks, str(len(facts["locked"]) or ""), "; ".join(remarks)]


def _marks() -> tuple[str, ...]:
    return tuple(_MARKS if console.shows(_MARKS) else _PLAIN_MARKS)


def which(some: Sequence[str], joints: Sequence[str]) -> str:
    """Names of some of a robot's joints in a sentence; "all joints" if these are all."""
    return "all joints" if len(some) == len(joints) else ", ".join(some)
