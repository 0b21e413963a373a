"""Readers of saved results and of other planners' files: motions and their facts.

They may be untrusted. Of a folder only files of known names are read, within bounds, and no link that leads out of it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import armdyn as ad
from armdyn.arrays import Array
from armdyn.errors import FileError, TrajectoryError, reraised
from armdyn.show.page.facts import Facts
from armdyn.show.results import load_result
from armdyn.trajectory import Trajectory
from armdyn.trajectory.npz import is_trajectory_file
from armdyn.trajectory.planned import SUFFIXES, read_planned

_REFERENCE_FILES = ("reference.npz", "optimum.npz")


@dataclass(frozen=True, eq=False)
class Saved:
    """A result on disk.

    Attributes:
        path: the folder, or the motion's file.
        motion: its motion.
        facts: of its result; empty for a bare motion.
        reference: the motion to follow, or the fastest one that it was compared with; None: neither.
        a: accelerations of a planner's file, shape (n, nv); None: it has none.
    """

    path: Path
    motion: Trajectory
    facts: Facts
    reference: Trajectory | None = None
    a: Array | None = None


def read_saved(path: Path) -> Saved:
    """A result: a folder that a command has written, its result.json, or a motion's npz file alone.

    Raises:
        FileError: the file is missing, or a link leads out of the folder.
        ResultError: its result.json cannot be read.
        TrajectoryError: its motion cannot be read.
    """
    folder = path if path.is_dir() else path.parent
    if not path.is_dir() and path.name != "result.json":
        file = folder / "result.json"
        judged = path.name == "trajectory.npz" and file.is_file()
        return Saved(path, Trajectory.load(path), Facts(load_result(_inside(file))) if judged else Facts())
    result, motion = folder / "result.json", folder / "trajectory.npz"
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


def is_given(path: Path) -> bool:
    """Whether the path is another planner's motion, and neither a folder nor a file of armdyn."""
    suffix = path.suffix.lower()
    if path.is_dir() or path.name == "result.json" or suffix not in SUFFIXES:
        return False
    return suffix != ".npz" or (path.is_file() and not is_trajectory_file(path))


def motion_of(robot: ad.Robot, file: Path) -> Saved:
    """The motion in a file, and its accelerations; torques that it has not are computed.

    Raises:
        TrajectoryError: it cannot be read, is of another robot, or its positions are degrees.
    """
    if is_trajectory_file(file):
        return Saved(file, Trajectory.load(file), Facts())
    planned = read_planned(file, robot.joint_names)
    _refuse_degrees(robot, file, planned.q)
    with reraised(TrajectoryError, str(file), TrajectoryError):
        motion = ad.trajectory_from_path(robot, planned.t, planned.q, planned.v, planned.a, name=file.stem)
    if planned.tau is not None:
        derived = tuple(what for what in motion.derived if what != "tau")
        motion = replace(motion, tau=planned.tau, hold=planned.hold, derived=derived)
    return Saved(file, motion, Facts(), a=None if planned.v is None else planned.a)


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
