"""A log of an arm: times, positions, velocities and torques as measured, and its files."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from scipy.ndimage import gaussian_filter1d

from armdyn.arguments import Checked, checked, each, expect, numbers, path_of, text
from armdyn.arrays import Array
from armdyn.errors import LogError, MissingPackageError, TrajectoryError, reraised
from armdyn.models.robots.robot import Robot, expect_robot
from armdyn.reprs import brief
from armdyn.trajectory import Trajectory
from armdyn.trajectory.npz import is_trajectory_file
from armdyn.trajectory.planned import read_planned
from armdyn.trajectory.value import Hold

BAGS = (".mcap", ".db3", ".bag")
"""Suffixes of ROS bags; a folder is a ROS 2 bag, too."""
MOST_SAMPLES = 2_000_000
"""A longer log is refused: 33 minutes at 1 kHz."""
_FEWEST = 50
_GAP = 20.0
"""Time without samples, in median steps, that is a gap: logs of a busy machine miss ten samples now and then."""
_ENDS = 5.0
"""Half a Gaussian filter, in standard deviations."""
_LEAST_WIDTH = 0.25
"""Samples in a standard deviation of the filter below which a log is too coarse: by default below 50 Hz."""
_JITTER = 0.01
"""Part of a step by which steps may differ before samples are interpolated at even times."""


@brief
@dataclass(frozen=True, kw_only=True, eq=False)
class Log(Checked):
    """Measurements of an arm that moves.

    Attributes:
        t: times [s], shape (n,), increasing, without gaps.
        q: joint positions [rad or m], shape (n, nv).
        tau: joint torques, at the joint, not the motor [N m or N], shape (n, nv).
        v: joint velocities [rad/s or m/s], shape (n, nv); None: from the positions.
        joint_names: of the columns; None: the robot's, in its order.
        name: in messages.

    Raises:
        LogError: shapes do not fit, a number is not finite, the clock jumps back, or there is a gap.
    """

    t: Array = checked(numbers, error=LogError)
    q: Array = checked(numbers, error=LogError)
    tau: Array = checked(numbers, error=LogError)
    v: Array | None = checked(numbers, None, error=LogError)
    joint_names: tuple[str, ...] | None = checked(each, None, of=text, error=LogError)
    name: str = "log"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.q.ndim != 2 or self.t.shape != self.q.shape[:1]:
            raise LogError(f"{self.name}: t has shape {self.t.shape} and q {self.q.shape}; they are (n,) and (n, nv)")
        for name in ("tau", "v"):
            own = getattr(self, name)
            if own is not None and own.shape != self.q.shape:
                raise LogError(f"{self.name}: {name} has shape {own.shape}, q {self.q.shape}")
        if (names := self.joint_names) is not None and not len(set(names)) == len(names) == self.q.shape[1]:
            raise LogError(f"{self.name}: {len(names)} joint names, some alike or not one per column")
        if not _FEWEST <= self.t.size <= MOST_SAMPLES:
            raise LogError(f"{self.name}: {self.t.size} samples; a log has {_FEWEST} to {MOST_SAMPLES}")
        self._check_finite()
        self._check_clock()

    def _of_whom(self) -> str:
        return f" of {text(self.name, 'name of a log', error=LogError)}"

    def _check_finite(self) -> None:
        for name in ("t", "q", "v", "tau"):
            own = getattr(self, name)
            if own is not None and (wrong := np.argwhere(~np.isfinite(own))).size:
                joints = self.joint_names or [f"joint {j + 1}" for j in range(self.q.shape[1])]
                joint = joints[wrong[0][1]] if own.ndim == 2 else None
                raise LogError(f"{self.name}: {name} is not finite in sample {wrong[0][0]}", joint)

    def _check_clock(self) -> None:
        steps = np.diff(self.t)
        if np.any(steps <= 0):
            at = int(np.argmax(steps <= 0))
            raise LogError(
                f"{self.name}: the clock jumps back or stands still: t is {self.t[at]:.6f} s in sample {at}, then "
                f"{self.t[at + 1]:.6f} s"
            )
        usual = float(np.median(steps))
        if np.max(steps) > _GAP * usual:
            at = int(np.argmax(steps))
            raise LogError(
                f"{self.name}: a gap of {steps[at]:.3g} s after t = {self.t[at]:.6f} s, other steps are {usual:.3g} s; "
                "cut the log there and give both parts as two logs"
            )

    def in_order(self, robot: Robot) -> Log:
        """This log with its columns in the order of a robot's joints.

        Raises:
            LogError: a joint is missing, or the number of columns differs.
        """
        names = expect_robot(robot).joint_names
        if self.joint_names is None:
            if self.q.shape[1] != len(names):
                raise LogError(f"{self.name} has {self.q.shape[1]} joints, the robot {len(names)}: {', '.join(names)}")
            return replace(self, joint_names=names)
        if missing := [name for name in names if name not in self.joint_names]:
            raise LogError(f"{self.name} has no joint {missing[0]!r}; it has {', '.join(self.joint_names)}", missing[0])
        order = [self.joint_names.index(name) for name in names]
        v = None if self.v is None else self.v[:, order]
        return replace(self, q=self.q[:, order], v=v, tau=self.tau[:, order], joint_names=names)

    @classmethod
    def of(cls, motion: Trajectory) -> Self:
        """The log of a simulated motion, such as `Run.trajectory`."""
        expect(motion, Trajectory, "motion", error=LogError)
        tau = _at_samples(motion.tau, motion.hold)
        return cls(t=motion.t, q=motion.q, v=motion.v, tau=tau, joint_names=motion.joint_names or None)

    @classmethod
    def load(cls, path: str | os.PathLike[str], robot: Robot) -> Self:
        """Read a log from a file; its size is bounded and nothing in it is executed.

        Args:
            path: a table .csv, .tsv or .txt with named columns such as `t,q1,…,v1,…,tau1,…` or `time,position_elbow,
                effort_elbow,…`, of degrees if the name says `[deg]`; an .npz of arrays t, q, v, tau, or of a
                `Trajectory`, as `of` reads it; or a ROS bag
                (.mcap, .db3, .bag, or a folder) of sensor_msgs/JointState, with the package rosbags.
            robot: whose joints are in it.

        Raises:
            LogError: it cannot be read, or has no torques.
            MissingPackageError: it is a bag, and rosbags is not installed.
        """
        file, joint_names = Path(path_of(path, "path of a log", error=LogError)), expect_robot(robot).joint_names
        if os.path.isdir(file) or file.suffix.lower() in BAGS:  # noqa: PTH112  # False for a name that is too long
            return cls._of_bag(file, joint_names)
        with reraised(LogError, "", TrajectoryError):
            if is_trajectory_file(file):
                return replace(cls.of(Trajectory.load(file)), name=file.name)
            found = read_planned(file, joint_names)
        if found.tau is None:
            raise LogError(
                f"{file}: there are no torques: columns tau1, tau2, … or effort_JOINT, in an npz an array tau"
            )
        return cls(t=found.t, q=found.q, v=found.v, tau=_at_samples(found.tau, found.hold), name=file.name)

    @classmethod
    def _of_bag(cls, file: Path, joint_names: Sequence[str]) -> Self:
        rows: list[tuple[float, Array]] = []
        for time, message in _joint_states(file):
            at = [list(message.name).index(name) for name in joint_names if name in message.name]
            if len(at) < len(joint_names):
                continue  # a gripper's own states
            if len(message.effort) != len(message.name):
                raise LogError(f"{file}: its JointState has no effort: there are no torques in it")
            v = message.velocity if len(message.velocity) == len(message.name) else np.full(len(message.name), np.nan)
            arrays = (message.position, v, message.effort)
            rows.append((time, np.stack([np.asarray(one, dtype=float)[at] for one in arrays])))
            if len(rows) > MOST_SAMPLES:
                raise LogError(f"{file}: more than {MOST_SAMPLES} samples")
        if not rows:
            raise LogError(f"{file}: no sensor_msgs/JointState has all of {', '.join(joint_names)}")
        values = np.stack([row for _, row in rows])
        v = None if np.any(np.isnan(values[:, 1])) else values[:, 1]
        return cls(
            t=np.array([time for time, _ in rows]) - rows[0][0], q=values[:, 0], v=v, tau=values[:, 2],
            joint_names=tuple(joint_names), name=file.name,
        )  # fmt: skip


def _at_samples(tau: Array, hold: Hold) -> Array:
    """Torques at the samples, shape (n, nv): the mean of those held before and after each, where they are held."""
    return tau if hold == "linear" else np.concatenate([tau[:1], (tau[1:] + tau[:-1]) / 2])


def _joint_states(file: Path) -> Iterator[tuple[float, Any]]:
    """Times of the headers [s] and messages of all JointStates of a bag."""
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise MissingPackageError("rosbags", f"reading the bag {file}", "write the log as a CSV table") from None
    try:
        with AnyReader([file], default_typestore=get_typestore(Stores.LATEST)) as reader:
            states: Any = [one for one in reader.connections if one.msgtype == "sensor_msgs/msg/JointState"]
            for connection, _, raw in reader.messages(connections=states):
                message: Any = reader.deserialize(raw, connection.msgtype)
                yield message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec, message
    except Exception as error:  # its storage raises many classes on a damaged bag
        raise LogError(f"{file}: not a readable bag ({str(error)[:200]})") from None


@dataclass(frozen=True, kw_only=True)
class Signals:
    """A log at even times, smoothed, with accelerations.

    Attributes:
        t: times [s], shape (n,).
        q: positions [rad or m], shape (n, nv).
        v: velocities [rad/s or m/s], shape (n, nv).
        a: accelerations [rad/s² or m/s²], shape (n, nv).
        tau: torques, smoothed likewise [N m or N], shape (n, nv).
        width: standard deviation of the filter, in samples.
    """

    t: Array
    q: Array
    v: Array
    a: Array
    tau: Array
    width: float

    @classmethod
    def of(cls, log: Log, smoothing: float) -> Self:
        """Smoothed signals and their derivatives by one Gaussian filter, which has no phase.

        Torques are smoothed by the same filter as the accelerations: where inertia is constant both sides of the
        equations of motion lose the same. The ends are cut off.

        Args:
            log: times may differ from even ones.
            smoothing: standard deviation of the filter [s], of one sample at least.

        Raises:
            LogError: too few samples per second, or the log is too short.
        """
        step = (log.t[-1] - log.t[0]) / (log.t.size - 1)
        even = bool(np.max(np.abs(np.diff(log.t) - step)) < _JITTER * step)
        times = np.linspace(log.t[0], log.t[-1], log.t.size)
        width = max(1.0, smoothing / step)
        cut = int(_ENDS * width)
        if smoothing / step < _LEAST_WIDTH or cut > log.t.size // 4:
            raise LogError(
                f"{log.name}: {log.t.size} samples, {1 / step:.3g} per second; smoothing by {smoothing:g} s needs "
                f"{_LEAST_WIDTH / smoothing:.3g} per second and {4 * _ENDS * smoothing:.3g} s at least"
            )

        def at_even_times(values: Array) -> Array:
            return values if even else np.column_stack([np.interp(times, log.t, own) for own in values.T])

        def smooth(values: Array, derivative: int) -> Array:
            return np.asarray(_gaussian(values, width, derivative) / step**derivative)

        tau, q = at_even_times(log.tau), at_even_times(log.q)
        if log.v is None:
            v = smooth(q, 1)
            # A kernel of order 2 that is cut off has a mean, which q / step² would show.
            a = np.gradient(v, step, axis=0)
        else:
            v, a = (smooth(at_even_times(log.v), derivative) for derivative in (0, 1))
        whole = cls(t=times, q=smooth(q, 0), v=v, a=a, tau=smooth(tau, 0), width=width)
        return whole.part(cut, log.t.size - cut)

    def part(self, start: int, end: int) -> Self:
        """Slice of the samples from one index to another."""
        arrays = [one.name for one in fields(self) if one.name != "width"]
        return replace(self, **{name: getattr(self, name)[start:end] for name in arrays})

    def samples_in(self, duration: float) -> int:
        """Number of samples in a duration [s], at least one."""
        return max(1, round(duration * (self.t.size - 1) / float(self.t[-1] - self.t[0])))

    def smoothed(self, values: Array) -> Array:
        """Values at the samples, such as a nonlinear function of the velocities, through the filter of the torques."""
        return _gaussian(values, self.width, 0)


def _gaussian(values: Array, width: float, derivative: int) -> Array:
    return np.asarray(gaussian_filter1d(values, width, axis=0, order=derivative, truncate=_ENDS))
