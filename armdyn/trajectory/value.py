"""Motions, the one result of solvers and simulations."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from armdyn.arguments import Checked, checked, expect, number, numbers, one_of, text
from armdyn.arrays import Array, Flags
from armdyn.errors import TrajectoryError
from armdyn.rendering import renderer
from armdyn.reprs import brief, called, joints_of
from armdyn.trajectory import npz
from armdyn.trajectory.interpolation import cubic
from armdyn.trajectory.pieces import JOIN_TOLERANCE, Load, Piece, check_pieces, cut, joined, split, to_text
from armdyn.trajectory.samples import LAST_STEP, LEAST_STEP, Samples, check_shapes, finite, names_of, samples_of

if TYPE_CHECKING:
    from pandas import DataFrame


_ARRAYS = ("t", "q", "v", "tau")

Hold = Literal["linear", "zero-order"]
"""Torque between two samples: linear, or that of the first sample, as a sampled controller holds it until the next."""
HOLDS: tuple[Hold, ...] = ("linear", "zero-order")


class Sample(NamedTuple):
    """The state and the torque at some times."""

    q: Array
    """Joint positions [rad or m], shape (..., nq)."""
    v: Array
    """Joint velocities [rad/s or m/s], shape (..., nv)."""
    tau: Array
    """Joint torques [N m or N], shape (..., nv)."""


@brief
@dataclass(frozen=True)
class Trajectory(Checked):
    """A motion: samples of state and torque over time.

    Between samples the position is the cubic that matches position and velocity at both ends. The torque is linear,
    or held, see `Hold`. A jump of a linear torque is two samples one ulp of time apart, so that bang-bang is exact.

    Attributes:
        t: times [s], shape (n,), strictly increasing by `LEAST_STEP` at least, n >= 2.
        q: joint positions, one number per joint [rad or m], shape (n, nq).
        v: joint velocities [rad/s or m/s], shape (n, nv).
        tau: joint torques [N m or N], shape (n, nv).
        joint_names: one name per column of v; may be empty.
        name: in legends and tables.
        model_hash: `Robot.model_hash` of the arm that it is a motion of; empty if it is not known. Of
            a motion with pieces it is theirs, and empty if they differ.
        hold: torque between samples, see `Hold`.
        pieces: parts with a model and payload of their own, in order; empty: the motion is one piece.
        ends: states that the motion was required to start and to end in, (q, v) of each, shape (2, 2, nv); NaN, or
            None: unknown. Its own first and last sample differ from them by the residual of its landing.
        derived: names of arrays that hold no more than the others, as of a planner's table: "v" if velocities are the
            derivative of a spline through the positions, "tau" if torques are those of accelerations by differences.
            They are judged as far as the others show them, see `check_motion`. Not saved.
    """

    t: Array = checked(finite)
    q: Array = checked(finite)
    v: Array = checked(finite)
    tau: Array = checked(finite)
    joint_names: tuple[str, ...] = checked(names_of, ())
    name: str = checked(text, "", error=TrajectoryError)
    model_hash: str = checked(text, "", error=TrajectoryError)
    hold: Hold = checked(one_of, "linear", known=HOLDS, error=TrajectoryError)
    pieces: tuple[Piece, ...] = ()
    ends: Array | None = checked(numbers, None, error=TrajectoryError)
    derived: tuple[str, ...] = checked(names_of, ())

    def __post_init__(self) -> None:
        super().__post_init__()
        check_shapes(self, _ARRAYS[1:])
        if self.ends is not None and self.ends.shape != (2, 2, self.v.shape[1]):
            raise TrajectoryError(f"ends has shape {self.ends.shape}; expected (2, 2, {self.v.shape[1]})")
        nearest = int(np.argmin(np.diff(self.t)))
        if self.t[nearest + 1] - self.t[nearest] < LEAST_STEP:
            raise TrajectoryError(
                f"t[{nearest + 1}] is {self.t[nearest + 1] - self.t[nearest]:.3g} s after t[{nearest}]; times are at "
                f"least {LEAST_STEP:g} s apart, a jump of the torque one ulp of a time that is not 0"
            )
        if self.v.shape != self.tau.shape:
            raise TrajectoryError(f"v has shape {self.v.shape} but tau {self.tau.shape}")
        object.__setattr__(self, "pieces", check_pieces(self.pieces, self.t))
        if self.pieces:
            own = {one.model_hash for one in self.pieces}
            object.__setattr__(self, "model_hash", own.pop() if len(own) == 1 else "")

    @staticmethod
    def at_rest(
        q: ArrayLike,
        tau: ArrayLike,
        duration: float,
        joint_names: tuple[str, ...] = (),
        *,
        name: str = "",
        model_hash: str = "",
    ) -> Trajectory:
        """A dwell: the arm stands still under constant torques.

        Args:
            q: joint positions [rad or m], shape (nv,).
            tau: torques that hold the arm there, such as `robot.holding_torque(q)` [N m or N], shape (nv,).
            duration: [s].
            joint_names: see `Trajectory`.
            name: see `Trajectory`.
            model_hash: see `Trajectory`.

        Raises:
            TrajectoryError: duration is not positive, or q and tau do not fit each other.
        """
        at, held = (numbers(x, name, error=TrajectoryError) for x, name in ((q, "q"), (tau, "tau")))
        end = number(duration, "duration", unit="s", sign="positive", error=TrajectoryError)
        if end < LEAST_STEP:
            raise TrajectoryError(f"duration is {end:.3g} s; it must be at least {LEAST_STEP:g} s")
        if at.ndim != 1 or at.shape != held.shape:
            raise TrajectoryError(f"q has shape {at.shape} and tau {held.shape}; expected one number per joint of both")
        still = np.zeros((2, at.size))
        return Trajectory(np.array([0.0, end]), still + at, still, still + held, joint_names, name, model_hash)

    @property
    def own_pieces(self) -> tuple[Piece, ...]:
        """`pieces`; of a motion without any, one with its name and model."""
        return self.pieces or (Piece(float(self.t[0]), self.name, self.model_hash),)

    @property
    def model_hashes(self) -> frozenset[str]:
        """`Robot.model_hash` of the arm in each piece; without empty ones."""
        return frozenset(one.model_hash for one in self.own_pieces) - {""}

    def as_piece(self, *, name: str | None = None, load: Load | None = None, event: str = "") -> Trajectory:
        """The motion as one piece, to be joined with others.

        Args:
            name: of the piece; None: the motion's.
            load: carried along the motion.
            event: occurs at its start; see `Piece`.
        """
        called = self.name if name is None else name
        return replace(self, pieces=(Piece(float(self.t[0]), called, self.model_hash, load, event),))

    def join(self, other: Trajectory, tolerance: float = JOIN_TOLERANCE) -> Trajectory:
        """This motion and then another one, which starts where this one ends; also `self + other`.

        The other's times are shifted. Its first sample is one ulp of time after this motion's last one, so that torques
        may jump; all samples keep their states. The pieces of both follow each other, see `own_pieces`.

        Args:
            other: a motion of the same joints.
            tolerance: largest difference of a joint's position [rad or m] and velocity [rad/s or m/s].

        Raises:
            TrajectoryError: the other motion starts elsewhere; the message names the joint. Or joints or `hold` differ.
        """
        return joined(self, expect(other, Trajectory, "other", error=TrajectoryError), tolerance)

    def __add__(self, other: object) -> Trajectory:
        """`join` with its default tolerance."""
        return self.join(other) if isinstance(other, Trajectory) else NotImplemented

    def slice(self, begin: float | None = None, end: float | None = None) -> Trajectory:
        """Part of the motion, in its own times, with its pieces.

        Torques are exact, and so are the cubics between samples. Of a jump at the begin or the end only the inner side
        is kept.

        Args:
            begin: [s]; None: the motion's begin.
            end: [s]; None: the motion's end.

        Raises:
            TrajectoryError: they do not increase, or are not within the motion.
        """
        return cut(self, begin, end)

    def split(self) -> tuple[Trajectory, ...]:
        """Each piece as a motion in the times of the whole, with its own name and model; their sum is the motion."""
        return split(self)

    def _repr_parts(self) -> list[str]:
        joints = self.v.shape[1]
        return [
            called(self.name) if self.name else "without a name",
            f"{self.duration:.6g} s",
            joints_of(joints),
            f"{self.t.size} samples",
            *([f"{len(self.pieces)} pieces"] if len(self.pieces) > 1 else []),
        ]

    def _repr_html_(self) -> str:
        """HTML for notebooks: a table and a picture."""
        return renderer().card(self)

    @property
    def duration(self) -> float:
        """Last time minus first [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def tau_end(self) -> Array:
        """Torque at the end of each interval between samples [N m or N], shape (n - 1, nv); it begins with `tau`."""
        return self.tau[:-1] if self.hold == "zero-order" else self.tau[1:]

    @property
    def jumps(self) -> Flags:
        """Mask of intervals without duration, shape (n - 1,): there a linear torque may jump.

        `jumps[k]` is of samples k and k + 1: they are one ulp of time apart, or two where a sum of times was rounded.
        """
        return np.asarray(np.diff(self.t) <= 2 * np.spacing(np.abs(self.t[1:])))

    @property
    def switch_times(self) -> tuple[tuple[float, ...], ...]:
        """For each joint the times at which a linear torque jumps [s], increasing; of each jump's first sample."""
        jumping = self.jumps[:, None] & (self.tau[1:] != self.tau[:-1])
        return tuple(tuple(map(float, self.t[:-1][column])) for column in jumping.T)

    def __call__(self, time: ArrayLike) -> Sample:
        """State and torque at one or many times [s]; outside the trajectory its ends are held.

        Returns:
            A `Sample` whose arrays have the shape of `time` plus one axis for the joints.

        Raises:
            TrajectoryError: the times are no numbers.
        """
        at: Array = np.clip(numbers(time, "time", "times [s]", error=TrajectoryError), self.t[0], self.t[-1])
        k = np.clip(np.searchsorted(self.t, at, side="right") - 1, 0, self.t.size - 2)
        left, tau0 = self.t[k], self.tau[k]
        h = (self.t[k + 1] - left)[..., None]
        s = (at - left)[..., None] / h
        q, v = cubic(s, h, (self.q[k], self.q[k + 1]), (self.v[k], self.v[k + 1]))
        return Sample(q, v, tau0 + s * (self.tau_end[k] - tau0))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write to an npz file; concurrent readers see the old file or the new one, whole.

        Returns:
            The path written, as given.

        Raises:
            DiskFullError: there is no room for it.
            FileError: the folder cannot be written.
            TrajectoryError: it is larger than `MAX_BYTES`.
        """
        texts = {"name": self.name, "model_hash": self.model_hash, "hold": self.hold, "pieces": to_text(self.pieces)}
        arrays = {field: getattr(self, field) for field in _ARRAYS}
        arrays |= {} if self.ends is None else {"ends": self.ends}
        return npz.write(path, arrays, texts, self.joint_names)

    @staticmethod
    def load(path: str | os.PathLike[str]) -> Trajectory:
        """Read a file of `save`. Nothing in the file is executed.

        Raises:
            TrajectoryError: the file is missing, no regular file, no trajectory, of an unknown version or in other
                units, or has arrays that do not fit or are larger than `MAX_BYTES`.
        """
        return npz.read(path, Trajectory)

    def resample(self, rate: float | None = None, least: float = LAST_STEP) -> Samples:
        """Sample the motion at even times: states, and torques to hold until the next time.

        Stamps are k / rate from the start, and the end itself. The last step is as short as it must be for that, or as
        `least` says. Torques are means over the step that begins at their stamp, as a controller holds its output
        for a tick. Accelerations are those at the stamp; where a torque jumps there, the smaller one of both sides.

        A motion that rests at an end does so exactly: the first (last) row has the position of `ends`, where it is
        known and the sample is within `LANDED` of it, and zeros for velocity and acceleration.

        Args:
            rate: samples per second [Hz], at most `MOST_RATE`; None: the motion's own samples, of those nearer to each
                other than `LEAST_STAMP`, as the two sides of a jump, only the first.
            least: least length of the last step, as a part of a tick, at most 1: a tick nearer to the end has no stamp.

        Raises:
            TrajectoryError: the rate is no number, the samples are more than `MOST_SAMPLES`, the motion is shorter than
                `LEAST_STAMP`, or q has not one column per joint.
        """
        return samples_of(self, rate, least)

    def to_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write the motion's samples as a table; see `resample` and `Samples.to_csv`."""
        return self.resample().to_csv(path)

    def to_dataframe(self) -> DataFrame:
        """The motion's samples as a pandas DataFrame; see `resample` and `Samples.to_dataframe`."""
        return self.resample().to_dataframe()

    def to_joint_trajectory(self) -> dict[str, Any]:
        """The motion's samples as a ROS 2 message; see `resample` and `Samples.to_joint_trajectory`."""
        return self.resample().to_joint_trajectory()
