"""The one value that leaves every solver and every simulation."""

import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.errors import TrajectoryError

Array = NDArray[np.float64]

_FORMAT = "armdyn-trajectory-1"
_ARRAYS = ("t", "q", "v", "tau")


class Sample(NamedTuple):
    """The state and the torque at some times."""

    q: Array
    """Joint positions [rad or m], shape (..., nq)."""
    v: Array
    """Joint velocities [rad/s or m/s], shape (..., nv)."""
    tau: Array
    """Joint torques [N m or N], shape (..., nv)."""


@dataclass(frozen=True)
class Trajectory:
    """A motion: samples of state and torque over time.

    Between samples the torque is linear and the position the cubic that matches position and
    velocity at both ends. A jump of the torque is two samples one ulp of time apart, so that this
    one rule also says bang-bang exactly.

    Attributes:
        t: times [s], shape (n,), strictly increasing, n >= 2.
        q: joint positions, one number per joint [rad or m], shape (n, nq).
        v: joint velocities [rad/s or m/s], shape (n, nv).
        tau: joint torques [N m or N], shape (n, nv).
        joint_names: one name per column of v; may be empty.
        name: what it is called in legends and tables.
    """

    t: Array
    q: Array
    v: Array
    tau: Array
    joint_names: tuple[str, ...] = ()
    name: str = ""

    def __post_init__(self) -> None:
        for field in _ARRAYS:
            try:
                array = np.array(getattr(self, field)).astype(float, casting="same_kind")
            except (TypeError, ValueError):
                raise TrajectoryError(f"{field} is not an array of numbers") from None
            array.setflags(write=False)
            object.__setattr__(self, field, array)
            if not np.all(np.isfinite(array)):
                raise TrajectoryError(f"{field} has a value that is not finite")
        n = self.t.shape[0] if self.t.ndim == 1 else 0
        if n < 2 or not np.all(np.diff(self.t) > 0):
            raise TrajectoryError(f"t must be at least two increasing times [s], got shape {self.t.shape}")
        for field in _ARRAYS[1:]:
            shape = getattr(self, field).shape
            if len(shape) != 2 or shape[0] != n:
                raise TrajectoryError(f"{field} has shape {shape}; expected ({n}, joints) as t has {n} samples")
        if self.v.shape != self.tau.shape:
            raise TrajectoryError(f"v has shape {self.v.shape} but tau {self.tau.shape}")
        object.__setattr__(self, "joint_names", tuple(self.joint_names))
        if self.joint_names and len(self.joint_names) != self.v.shape[1]:
            raise TrajectoryError(f"{len(self.joint_names)} joint names for {self.v.shape[1]} joints")

    @property
    def duration(self) -> float:
        """Last time minus first [s]."""
        return float(self.t[-1] - self.t[0])

    def __call__(self, time: ArrayLike) -> Sample:
        """State and torque at one or many times [s]; outside the trajectory its ends are held.

        Returns:
            A `Sample` whose arrays have the shape of `time` plus one axis for the joints.
        """
        at: Array = np.clip(np.asarray(time, dtype=float), self.t[0], self.t[-1])
        k = np.clip(np.searchsorted(self.t, at, side="right") - 1, 0, self.t.size - 2)
        h = (self.t[k + 1] - self.t[k])[..., None]
        s = (at - self.t[k])[..., None] / h
        rise = self.q[k + 1] - self.q[k]
        # Cubic Hermite in s: https://en.wikipedia.org/wiki/Cubic_Hermite_spline, in Horner form.
        c2 = 3 * rise - h * (2 * self.v[k] + self.v[k + 1])
        c3 = -2 * rise + h * (self.v[k] + self.v[k + 1])
        q = self.q[k] + s * (h * self.v[k] + s * (c2 + s * c3))
        v = self.v[k] + s * (2 * c2 + 3 * s * c3) / h
        tau = self.tau[k] + s * (self.tau[k + 1] - self.tau[k])
        return Sample(q, v, tau)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write to an npz file; whoever reads it meanwhile sees the old file or the new one, whole.

        Returns:
            The path written, as given.

        Raises:
            OSError: the folder cannot be written.
        """
        path = Path(path)
        handle, scratch = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez_compressed(
                    file,
                    format=np.array(_FORMAT),
                    units=np.array("t s; q rad or m; v rad/s or m/s; tau N m or N"),
                    name=np.array(self.name),
                    joint_names=np.array(self.joint_names, dtype=str),
                    **{field: getattr(self, field) for field in _ARRAYS},
                )
            Path(scratch).chmod(0o644)
            Path(scratch).replace(path)
        except BaseException:
            Path(scratch).unlink(missing_ok=True)
            raise
        return path

    @staticmethod
    def load(path: str | os.PathLike[str]) -> "Trajectory":
        """Read what `save` wrote. Nothing in the file is executed.

        Raises:
            TrajectoryError: the file is missing, is no trajectory, or has arrays that do not fit.
        """
        try:
            with np.load(path, allow_pickle=False) as file:
                if "format" not in file or str(file["format"]) != _FORMAT:
                    raise TrajectoryError(f"not a trajectory of format {_FORMAT}")
                return Trajectory(
                    **{field: file[field] for field in _ARRAYS},
                    joint_names=tuple(map(str, file["joint_names"])),
                    name=str(file["name"]),
                )
        except TrajectoryError as error:
            raise TrajectoryError(f"{path}: {error}") from None
        except FileNotFoundError:
            raise TrajectoryError(f"{path}: no such file") from None
        except Exception as error:  # a damaged file sets off all that zipfile, zlib and numpy can raise
            raise TrajectoryError(f"{path}: not a readable npz trajectory ({error})") from None
