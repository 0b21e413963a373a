"""A motion from any planner's file, as a motion of a robot: missing quantities are computed.

Readers of files load numpy and are imported where they are used: help does without.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import armdyn as ad

if TYPE_CHECKING:
    from armdyn.show.page.facts import Facts


def is_given(path: Path) -> bool:
    """Whether it is a motion as other planners leave it, and neither a folder nor a file of armdyn."""
    from armdyn.trajectory.npz import is_own
    from armdyn.trajectory.planned import SUFFIXES

    suffix = path.suffix.lower()
    if path.is_dir() or path.name == "result.json" or suffix not in SUFFIXES:
        return False
    return suffix != ".npz" or (path.is_file() and not is_own(path))


def motion_of(robot: ad.Robot, file: Path) -> ad.Trajectory:
    """The motion in a file; torques that it has not are computed.

    Raises:
        TrajectoryError: it cannot be read, or is of another robot.
        MissingPackageError: it is YAML, and PyYAML is not installed.
    """
    from armdyn.trajectory.npz import is_own
    from armdyn.trajectory.planned import read_planned

    if is_own(file):
        return ad.Trajectory.load(file)
    planned = read_planned(file, robot.joint_names)
    a = planned.accelerations() if planned.a is None and planned.tau is None else planned.a
    motion = ad.trajectory_from_path(robot, planned.t, planned.q, planned.v, a, name=file.stem)
    return motion if planned.tau is None else replace(motion, tau=planned.tau)


def checked(robot: ad.Robot, motion: ad.Trajectory) -> Facts:
    """Checks of a bare motion: whether it satisfies limits, and whether its torques lead to its end.

    Args:
        robot: with the limits that hold.
        motion: of it.
    """
    from armdyn.optimal.gap import check_motion
    from armdyn.show.page.facts import Facts

    return Facts(check_motion(robot, motion).facts())
