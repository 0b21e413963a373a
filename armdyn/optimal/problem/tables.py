"""The table [problem] of a problem file: its writer."""

from dataclasses import fields
from typing import Any

import numpy as np

from armdyn.models.presets.preset import ControllerPreset
from armdyn.models.scene.obstacles import Obstacle, obstacle_entry
from armdyn.models.scene.reaching import GoalPose
from armdyn.models.values.placement import pose_entry
from armdyn.optimal.problem.planning_limits import PathConstraintSpec


def problem_table(problem: Any) -> dict[str, Any]:
    """The table [problem] that describes a `MinimumTimeProblem`."""
    given = {}
    for own in fields(problem):
        value = problem.own_rates.get(own.name, getattr(problem, own.name))
        found = own.name == "q_goal" and problem.goal_pose is not None  # by inverse kinematics
        if own.init and own.name != "robot" and not found and not _is_default(value, own.default):
            given[own.name] = _plain(value)
    if isinstance(problem.effort_limit, tuple) and len(problem.effort_limit) == 2:
        given["effort_limit"] = [np.broadcast_to(end, problem.robot.nv).tolist() for end in problem.effort_limit]
    return given


def _is_default(value: object, default: object) -> bool:
    """Whether a field has its default value; zero velocity counts as default."""
    if isinstance(value, tuple | list) or value is None:
        return not value
    if isinstance(value, np.ndarray):
        return bool(np.all(value == (0.0 if default is None else default)))
    return value == default


def _plain(value: Any) -> Any:
    """A field's value as numbers, strings, lists and tables, for TOML."""
    if isinstance(value, GoalPose):
        region = {"free": list(value.free), "tolerance": list(value.tolerance)}
        return {
            "frame": value.frame,
            **pose_entry(value.pose.homogeneous, turned=np.ndim(value.placement) == 2),
            **{name: entries for name, entries in region.items() if entries},
        }
    if isinstance(value, Obstacle):
        return obstacle_entry(value)
    if isinstance(value, PathConstraintSpec):
        entry = value.entry()
        return entry if isinstance(entry, str) else {key: _plain(one) for key, one in entry.items()}
    if isinstance(value, ControllerPreset):
        return value.to_text() or value.to_table()
    if isinstance(value, tuple | list):
        return [_plain(one) for one in value]
    return np.asarray(value).tolist()
