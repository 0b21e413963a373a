"""The one reader of motions' files for the commands: saved results, and files of other planners.

They may be untrusted. Of a folder only files of known names are read, within bounds, and no link that leads out of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import armdyn as ad
from armdyn.arrays import Array
from armdyn.errors import FileError, ProblemError, TrajectoryError, reraised
from armdyn.show.page.facts import Facts
from armdyn.show.results import load_result
from armdyn.trajectory import Trajectory
from armdyn.trajectory.npz import is_trajectory_file
from armdyn.trajectory.planned import SUFFIXES, Planned, read_planned

_REFERENCE_FILES = ("reference.npz", "optimum.npz")


@dataclass(frozen=True, eq=False)
class Saved:
    """A motion on disk.

    Attributes:
        path: the folder, or the motion's file.
        motion: the motion; torques that a planner's file has not are computed.
        facts: of its result; empty for a bare motion.
        reference: the motion to follow, or the fastest one that it was compared with; None: neither.
        table: content of a planner's file; None: it is armdyn's own.
    """

    path: Path
    motion: Trajectory
    facts: Facts
    reference: Trajectory | None = None
    table: Planned | None = None

    @property
    def a(self) -> Array | None:
        """Accelerations that a controller is given with the velocities, shape (n, nv); None: none."""
        return None if self.table is None or self.table.v is None else self.table.a


def read_saved(path: Path, robot: ad.Robot | None = None) -> Saved:
    """A result: a folder that a command has written, its result.json, a motion's npz file alone, or a planner's file.

    Args:
        path: of one of these.
        robot: that moves, for a planner's file.

    Raises:
        FileError: the file is missing, or a link leads out of the folder.
        ResultError: its result.json cannot be read.
        TrajectoryError: its motion cannot be read, is of another robot, or its positions are degrees.
        ProblemError: it is a planner's file, and there is no robot.
    """
    if is_planners(path):
        if robot is None:
            raise ProblemError(f"{path} needs its robot, which was not found: give --robot")
        table = read_planned(path, robot.joint_names)
        return Saved(path, motion_of(robot, table, path), Facts(), table=table)
    whole = path.is_dir() or path.name == "result.json"
    folder = path if path.is_dir() else path.parent
    result, motion = folder / "result.json", folder / "trajectory.npz"
    if not whole:
        judged = path.name == motion.name and result.is_file()
        return Saved(path, Trajectory.load(path), Facts(load_result(_inside(result))) if judged else Facts())
    if not motion.is_file():
        raise FileError(
            motion, "no such file: give the folder of one motion, as mintime, cycle, pid and track write it"
        )
    facts = Facts(load_result(_inside(result)))
    other = next((folder / name for name in _REFERENCE_FILES if (folder / name).is_file()), None)
    followed = None if other is None else Trajectory.load(_inside(other))
    return Saved(folder, Trajectory.load(_inside(motion)), facts, followed)


def _inside(file: Path) -> Path:
    """The file, if its real path is in its folder.

    Raises:
        FileError: it leads elsewhere.
    """
    if file.resolve().parent != file.parent.resolve():
        raise FileError(file, "leads out of its folder, which is refused")
    return file


def is_planners(path: Path) -> bool:
    """Whether the path is another planner's motion, and neither a folder nor a file of armdyn."""
    suffix = path.suffix.lower()
    if path.is_dir() or path.name == "result.json" or suffix not in SUFFIXES:
        return False
    return suffix != ".npz" or (path.is_file() and not is_trajectory_file(path))


def motion_of(robot: ad.Robot, table: Planned, file: Path) -> Trajectory:
    """The motion of a planner's file; torques that it has not are computed.

    Raises:
        TrajectoryError: it is of another robot, or its positions are degrees.
    """
    _refuse_degrees(robot, file, table.q)
    with reraised(TrajectoryError, str(file), TrajectoryError):
        motion = ad.trajectory_from_path(robot, table.t, table.q, table.v, table.a, name=file.stem)
    if table.tau is None:
        return motion
    return replace(
        motion, tau=table.tau, hold=table.hold, derived=tuple(what for what in motion.derived if what != "tau")
    )


def _refuse_degrees(robot: ad.Robot, file: Path, q: Array) -> None:
    """Refuse positions far beyond the limits, shape (n, nv), that are within them as degrees."""
    limits, turns = robot.limits, ~robot.slides

    def beyond(positions: Array) -> Array:
        return np.maximum(limits.position_lower - positions, positions - limits.position_upper)

    far, meant = np.where(turns, beyond(q), -np.inf), beyond(np.where(turns, np.deg2rad(q), q))
    if np.max(far) > np.pi and np.max(meant) <= 0:
        k, j = np.unravel_index(np.argmax(far), far.shape)
        raise TrajectoryError(
            f"{file}: {robot.joint_names[j]} is at {q[k, j]:.4g} rad, and its limits are "
            f"[{limits.position_lower[j]:.4g}, {limits.position_upper[j]:.4g}] rad: these are degrees; positions are "
            f"radians, in a table also degrees in columns named 'q{j + 1} [deg]'"
        )
