"""Motions sampled for controllers: distinct stamps, torques held between them."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armdyn.arguments import Checked, checked, each, number, numbers, text
from armdyn.arrays import Array
from armdyn.errors import TrajectoryError
from armdyn.files import write_whole
from armdyn.reprs import brief, joints_of
from armdyn.trajectory.formats.csv_table import CsvTable, dataframe
from armdyn.trajectory.formats.mujoco import Mujoco
from armdyn.trajectory.formats.ros2 import joint_trajectory
from armdyn.trajectory.tables import check_times

if TYPE_CHECKING:
    from pandas import DataFrame

    from armdyn.trajectory.pieces import Piece
    from armdyn.trajectory.value import Trajectory


MOST_RATE = 1e5
"""Samples per second beyond which a rate is a mistake [Hz]: drives close their current loops ten times slower."""

MOST_SAMPLES = 200_000
"""Of one motion: 200 s at 1 kHz. Of seven joints they are 130 MB of JSON."""

LEAST_STAMP = 1e-8
"""Least time between two stamps [s]: ten of ROS's nanoseconds."""

LEAST_STEP = 1e-30
"""Times of a motion nearer than that are refused [s]: rates over them, and squares of rates, overflow. An ulp of
a femtosecond is longer."""

LAST_STEP = 1e-3
"""Least length of the last step, as a part of a tick. At `MOST_RATE` that is `LEAST_STAMP`."""

LANDED = (1e-5, 0.02)
"""Distance [rad or m] and velocity [rad/s or m/s] of a motion's end from the required one that are the residual of its
landing: ten times the largest goal error of a certified motion, and the velocity error with which motions land."""

_REST = 1e-4
"""Velocity at rest [rad/s or m/s], of a motion whose required ends are unknown: three times the largest that certified
motions from rest to rest were seen to land with."""

_SIDE = 1 / 32
"""Part of the step over which the acceleration before, and after, a stamp is measured."""


def finite(value: object, name: str) -> Array:
    """An array of finite numbers.

    Raises:
        TrajectoryError: it is no such array.
    """
    array = numbers(value, name, "an array of numbers", error=TrajectoryError)
    if not np.all(np.isfinite(array)):
        raise TrajectoryError(f"{name} has a value that is not finite")
    return array


names_of = partial(each, of=text, error=TrajectoryError)
"""The check of a motion's `joint_names`."""


def check_shapes(motion: Any, arrays: Sequence[str]) -> None:
    """Check that times increase, and that the arrays and names of trajectories and samples fit them.

    Args:
        motion: its fields are checked one by one.
        arrays: names of the arrays but the times.

    Raises:
        TrajectoryError: they do not.
    """
    check_times(motion.t, [getattr(motion, field) for field in arrays])
    n = motion.t.size
    for field in arrays:
        shape = getattr(motion, field).shape
        if len(shape) != 2 or shape[0] != n:
            raise TrajectoryError(f"{field} has shape {shape}; expected ({n}, joints) as t has {n} samples")
    if (count := len(motion.joint_names)) and count != motion.v.shape[1]:
        raise TrajectoryError(f"{count} joint names for {joints_of(motion.v.shape[1])}")


@brief
@dataclass(frozen=True)
class Samples(Checked):
    """States at strictly increasing stamps, and torques held from each stamp to the next.

    `Trajectory.resample` makes them. Rows of `tau` are means over the step that begins at their stamp; the last row
    repeats the one before. The holding torque after the end is not included. Rows of `a` are those at the stamp, and
    zero where the motion rests at an end.

    Attributes:
        t: stamps [s], shape (n,), n >= 2, the first 0.
        q: joint positions at the stamps [rad or m], shape (n, nv).
        v: joint velocities at the stamps [rad/s or m/s], shape (n, nv).
        a: joint accelerations at the stamps [rad/s² or m/s²], shape (n, nv).
        tau: mean joint torques over the steps [N m or N], shape (n, nv).
        joint_names: one name per column; may be empty.
        name: of the motion.
        model_hash: `Robot.model_hash` of the arm that it is a motion of; empty if it is not known.
        pieces: of the motion, their starts measured from its start; empty: the motion is one piece.

    Raises:
        TrajectoryError: arrays do not fit each other, a number is not finite, or stamps do not increase from 0.
    """

    t: Array = checked(finite)
    q: Array = checked(finite)
    v: Array = checked(finite)
    a: Array = checked(finite)
    tau: Array = checked(finite)
    joint_names: tuple[str, ...] = checked(names_of, ())
    name: str = checked(text, "", error=TrajectoryError)
    model_hash: str = checked(text, "", error=TrajectoryError)
    pieces: tuple[Piece, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        check_shapes(self, ("q", "v", "a", "tau"))
        if self.t[0] != 0:
            raise TrajectoryError(f"t begins at {self.t[0]:g} s; stamps are times [s] from 0 on")
        for field in ("v", "a", "tau"):
            if (shape := getattr(self, field).shape) != self.q.shape:
                raise TrajectoryError(f"{field} has shape {shape}; expected {self.q.shape} as q has")

    @property
    def piece_rows(self) -> list[int]:
        """Row of each piece: the first one whose stamp is not before the piece's start."""
        starts = np.array([one.start for one in self.pieces])
        return [int(k) for k in np.minimum(np.searchsorted(self.t, starts - LEAST_STAMP), self.t.size - 1)]

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write a table: a head with names and units, a row per stamp, numbers that read back to the last bit.

        Of a motion of several pieces each row also has the piece's name, the event that occurs there, and the mass of
        the load.

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


def samples_of(motion: Trajectory, rate: float | None, least: float) -> Samples:
    """Sample a motion at even times, or at its own; see `Trajectory.resample`."""
    if motion.q.shape[1] != motion.v.shape[1]:
        raise TrajectoryError(
            f"q has {motion.q.shape[1]} columns, v {motion.v.shape[1]}; expected one of each per joint, to be resampled"
        )
    if motion.duration < LEAST_STAMP:
        raise TrajectoryError(f"the motion lasts {motion.duration:.3g} s; expected at least {LEAST_STAMP:g} s")
    t = _own_times(motion) if rate is None else _even_times(motion.duration, rate, least)
    with np.errstate(over="ignore", invalid="ignore"):  # overflows are refused by name
        state = motion(np.minimum(motion.t[0] + t, motion.t[-1]))
        q, v, a = state.q, state.v, _accelerations(motion, t)
        tau = mean_torques(motion, t)
    for k in (0, -1):
        q[k], v[k] = landed(motion, k)
        a[k] = a[k] if np.any(v[k]) else 0.0
    return Samples(
        t=t, q=q, v=v, a=a, tau=np.vstack([tau, tau[-1:]]),
        joint_names=motion.joint_names, name=motion.name, model_hash=motion.model_hash,
        pieces=tuple(replace(one, start=one.start - float(motion.t[0])) for one in motion.pieces),
    )  # fmt: skip


def landed(motion: Trajectory, k: int) -> tuple[Array, Array]:
    """Position and velocity at the start (k = 0) or the end (-1), without the residual of the landing."""
    q, v = motion.q[k], motion.v[k]
    if motion.ends is None or np.any(np.isnan(motion.ends[k])):
        return q, np.where(np.all(np.abs(v) <= _REST), 0.0, v)
    (asked, speed), (near, slow) = motion.ends[k], LANDED
    close, alike = np.all(np.abs(q - asked) <= near), np.all(np.abs(v - speed) <= slow)
    return np.where(close, asked, q), np.where(alike, speed + 0.0, v)  # no -0.0 of a motion backwards


def _accelerations(motion: Trajectory, t: Array) -> Array:
    """Accelerations at stamps [rad/s² or m/s²], shape (n, nv): slopes of the velocity on both sides of each stamp.

    Of two that differ, where a torque jumps, the one nearer to zero, and zero between those of different signs: a
    quintic between the rows then does not overshoot the velocity that the motion has reached.
    """
    aside = _SIDE * np.diff(t)
    at = np.concatenate([t[1:] - aside, t, t[:-1] + aside])
    before, here, after = np.split(motion(np.minimum(motion.t[0] + at, motion.t[-1])).v, [aside.size, -aside.size])
    rise = (after - here[:-1]) / aside[:, None]
    fall = (here[1:] - before) / aside[:, None]
    left, right = np.vstack([rise[:1], fall]), np.vstack([rise, fall[-1:]])
    nearer = np.where(np.abs(left) < np.abs(right), left, right)
    return np.where(left * right > 0, nearer, 0.0)


def _even_times(duration: float, rate: float, least: float) -> Array:
    """Multiples of the period from the start, and the end [s], shape (n,); `least` as of `Trajectory.resample`."""
    least = number(least, "least", least=LAST_STEP, most=1.0, error=TrajectoryError)
    rate = number(rate, "rate", unit="Hz", sign="positive", most=MOST_RATE, error=TrajectoryError)
    ticks = duration * rate
    _check_count(ticks + 1, f"{duration:g} s at {rate:g} Hz")
    whole = np.arange(int(np.ceil(ticks)) + 1)
    whole = whole[(whole == 0) | (whole <= ticks - least)]
    return np.append(whole / rate, duration)


def _own_times(motion: Trajectory) -> Array:
    """The motion's own times from the start [s], shape (n,), each `LEAST_STAMP` or more after the one before."""
    own = motion.t - motion.t[0]
    kept = [0]
    for k in (np.flatnonzero(~motion.jumps) + 1).tolist():
        if own[k] - own[kept[-1]] >= LEAST_STAMP:
            kept.append(k)
    kept = [k for k in kept if k == 0 or own[-1] - own[k] >= LEAST_STAMP]  # the end itself stays
    _check_count(len(kept) + 1, "the motion's own")
    return np.append(own[kept], own[-1])


def _check_count(count: float, what: str) -> None:
    if count > MOST_SAMPLES:
        raise TrajectoryError(f"{what} samples are {count:.0f}; expected at most {MOST_SAMPLES}: give a lower rate")


def mean_torques(motion: Trajectory, t: Array) -> Array:
    """Mean torque over each step [N m or N], shape (n - 1, nv).

    Over a piece without a sample of the motion inside, the mean of a linear or held torque is its value in the middle.

    Args:
        motion: whose torques they are.
        t: edges of the steps, from the motion's start [s], shape (n,), increasing, within its duration.
    """
    own = motion.t - motion.t[0]
    edges = np.union1d(own, t)
    edges = edges[edges <= t[-1]]
    lengths, middles = np.diff(edges), (edges[1:] + edges[:-1]) / 2
    if motion.hold == "linear":
        tau = np.stack([np.interp(middles, own, column) for column in motion.tau.T], axis=1)
    else:
        tau = motion.tau[np.searchsorted(own, middles) - 1]
    first = np.searchsorted(edges, t[:-1])
    return np.asarray(np.add.reduceat(tau * lengths[:, None], first) / np.add.reduceat(lengths, first)[:, None])
