"""A motion sampled for a controller: one row per stamp."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import numbers, several, text
from armdyn.errors import TrajectoryError
from armdyn.files import write_whole
from armdyn.reprs import brief
from armdyn.trajectory.formats.csv_table import CsvTable, dataframe
from armdyn.trajectory.formats.mujoco import Mujoco
from armdyn.trajectory.formats.ros2 import joint_trajectory

if TYPE_CHECKING:
    from pandas import DataFrame

Array = NDArray[np.float64]

_ARRAYS = ("t", "q", "v", "a", "tau")


def check_fields(motion: Any, arrays: Sequence[str]) -> None:
    """Check and freeze the fields that trajectories and samples share: arrays, joint names, texts.

    Args:
        motion: whose fields are replaced.
        arrays: names of the arrays.

    Raises:
        TrajectoryError: a field is no array of finite numbers, or no text.
    """
    for field in arrays:
        array = numbers(getattr(motion, field), field, "an array of numbers", error=TrajectoryError)
        array.setflags(write=False)
        object.__setattr__(motion, field, array)
        if not np.all(np.isfinite(array)):
            raise TrajectoryError(f"{field} has a value that is not finite")
    names = several(motion.joint_names, "joint_names", error=TrajectoryError)
    names = tuple(text(name, f"joint_names[{i}]", error=TrajectoryError) for i, name in enumerate(names))
    object.__setattr__(motion, "joint_names", names)
    for field in ("name", "model_hash"):
        text(getattr(motion, field), field, error=TrajectoryError)


@brief
@dataclass(frozen=True)
class Samples:
    """States at strictly increasing stamps, and torques held from each stamp to the next.

    `Trajectory.resample` makes them. Rows of `a` and `tau` are means over the step that begins at their stamp; the
    last rows repeat those before them. The holding torque after the end is not included.

    Attributes:
        t: stamps [s], shape (n,), n >= 2, the first 0.
        q: joint positions at the stamps [rad or m], shape (n, nv).
        v: joint velocities at the stamps [rad/s or m/s], shape (n, nv).
        a: mean joint accelerations over the steps [rad/s² or m/s²], shape (n, nv).
        tau: mean joint torques over the steps [N m or N], shape (n, nv).
        joint_names: one name per column; may be empty.
        name: of the motion.
        model_hash: `Robot.model_hash` of the arm that it is a motion of; empty if it is not known.

    Raises:
        TrajectoryError: arrays do not fit each other, a number is not finite, or stamps do not increase from 0.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    joint_names: tuple[str, ...] = ()
    name: str = ""
    model_hash: str = ""

    def __post_init__(self) -> None:
        check_fields(self, _ARRAYS)
        if self.t.ndim != 1 or self.t.size < 2 or self.t[0] != 0 or not np.all(np.diff(self.t) > 0):
            raise TrajectoryError(f"t must be at least two increasing stamps [s] from 0 on, got shape {self.t.shape}")
        for field in _ARRAYS[1:]:
            shape = getattr(self, field).shape
            if len(shape) != 2 or shape != (self.t.size, self.q.shape[-1]):
                raise TrajectoryError(f"{field} has shape {shape}; expected ({self.t.size}, joints) as t and q have")
        if self.joint_names and len(self.joint_names) != self.q.shape[1]:
            raise TrajectoryError(f"{len(self.joint_names)} joint names for {self.q.shape[1]} joints")

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write a table: a head with names and units, a row per stamp, numbers that read back to the last bit.

        Returns:
            The path written, as given.

        Raises:
            DiskFullError: there is no room for it.
            FileError: the folder cannot be written.
        """
        return write_whole(path, CsvTable().text(self).encode())

    def to_dataframe(self) -> DataFrame:
        """The table of `to_csv` as a pandas DataFrame; it needs `pip install pandas`.

        Raises:
            MissingPackageError: pandas is not installed.
        """
        return dataframe(self)

    def to_joint_trajectory(self) -> dict[str, Any]:
        """The fields of a ROS 2 message `trajectory_msgs/msg/JointTrajectory`, of Python's own numbers, texts, lists.

        Stamps are whole nanoseconds, strictly increasing, the first 0. A message is made of it by
        `rosidl_runtime_py.set_message.set_message_fields(JointTrajectory(), fields)`.

        Raises:
            TrajectoryError: joints have no names, two stamps are the same nanosecond, or there are more seconds than
                the message counts.
        """
        return joint_trajectory(self)

    def to_mjcf(self, *, motors: bool = True) -> str:
        """MuJoCo's XML, to be included in a model of the arm: a keyframe per stamp, and motors.

        A keyframe has time, qpos, qvel and, as ctrl, the torques to hold until the next.

        Args:
            motors: write a motor per joint, too, that gives a torque of 1 N m per 1 of ctrl: for a model without
                actuators, as MuJoCo makes of a URDF. False for one that has such motors, in the order of the joints.

        Raises:
            TrajectoryError: joints have no names, or one that XML cannot say.
        """
        return Mujoco(motors).text(self)
