"""The one value that leaves every solver and every simulation."""

import io
import os
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armdyn.arguments import numbers, several, text
from armdyn.arguments import path as path_of
from armdyn.errors import FileError, TrajectoryError
from armdyn.files import read_bounded, write_whole

Array = NDArray[np.float64]

_FORMAT = "armdyn-trajectory-2"
_OLD_FORMAT = "armdyn-trajectory-1"  # without model_hash, its units not checked
_UNITS = "t s; q rad or m; v rad/s or m/s; tau N m or N"
_ARRAYS = ("t", "q", "v", "tau")
_TEXTS = ("format", "units", "name", "model_hash")

MAX_BYTES = 256 * 2**20
"""A trajectory whose arrays are larger is neither saved nor loaded [bytes]: 1.5 million samples of seven joints."""

_HEADS = 2**20
"""That its file may have beside the arrays [bytes]."""

_LONGEST = 500
"""Characters of a message about a file: numpy quotes what it finds there."""

LEAST_STEP = 1e-30
"""Times nearer than that are refused [s]: rates over them, and squares of rates, leave what numbers can hold. An ulp of
a femtosecond is longer."""


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
        t: times [s], shape (n,), strictly increasing by `LEAST_STEP` at least, n >= 2.
        q: joint positions, one number per joint [rad or m], shape (n, nq).
        v: joint velocities [rad/s or m/s], shape (n, nv).
        tau: joint torques [N m or N], shape (n, nv).
        joint_names: one name per column of v; may be empty.
        name: what it is called in legends and tables.
        model_hash: `Robot.model_hash` of the arm that it is a motion of; empty if it is not known.
    """

    t: Array
    q: Array
    v: Array
    tau: Array
    joint_names: tuple[str, ...] = ()
    name: str = ""
    model_hash: str = ""

    def __post_init__(self) -> None:
        for field in _ARRAYS:
            array = numbers(getattr(self, field), field, "an array of numbers", error=TrajectoryError)
            array.setflags(write=False)
            object.__setattr__(self, field, array)
            if not np.all(np.isfinite(array)):
                raise TrajectoryError(f"{field} has a value that is not finite")
        n = self.t.shape[0] if self.t.ndim == 1 else 0
        if n < 2 or not np.all(np.diff(self.t) > 0):
            raise TrajectoryError(f"t must be at least two increasing times [s], got shape {self.t.shape}")
        nearest = int(np.argmin(np.diff(self.t)))
        if self.t[nearest + 1] - self.t[nearest] < LEAST_STEP:
            raise TrajectoryError(
                f"t[{nearest + 1}] is {self.t[nearest + 1] - self.t[nearest]:.3g} s after t[{nearest}]; times are at "
                f"least {LEAST_STEP:g} s apart, a jump of the torque one ulp of a time that is not 0"
            )
        for field in _ARRAYS[1:]:
            shape = getattr(self, field).shape
            if len(shape) != 2 or shape[0] != n:
                raise TrajectoryError(f"{field} has shape {shape}; expected ({n}, joints) as t has {n} samples")
        if self.v.shape != self.tau.shape:
            raise TrajectoryError(f"v has shape {self.v.shape} but tau {self.tau.shape}")
        names = several(self.joint_names, "joint_names", error=TrajectoryError)
        names = tuple(text(name, f"joint_names[{i}]", error=TrajectoryError) for i, name in enumerate(names))
        object.__setattr__(self, "joint_names", names)
        for field in ("name", "model_hash"):
            text(getattr(self, field), field, error=TrajectoryError)
        if self.joint_names and len(self.joint_names) != self.v.shape[1]:
            raise TrajectoryError(f"{len(self.joint_names)} joint names for {self.v.shape[1]} joints")

    @property
    def duration(self) -> float:
        """Last time minus first [s]."""
        return float(self.t[-1] - self.t[0])

    @property
    def jumps(self) -> NDArray[np.bool_]:
        """Where no time passes from one sample to the next, shape (n - 1,): there the torque may jump.

        `jumps[k]` is of samples k and k + 1: they are one ulp of time apart, or two where a sum of times was rounded.
        """
        return np.asarray(np.diff(self.t) <= 2 * np.spacing(self.t[1:]))

    @property
    def switch_times(self) -> tuple[tuple[float, ...], ...]:
        """For each joint the times at which its torque jumps [s], increasing; of each jump's first sample."""
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
            DiskFullError: there is no room for it.
            OSError: the folder cannot be written.
            TrajectoryError: it is larger than `MAX_BYTES`.
        """
        arrays = {field: getattr(self, field) for field in _ARRAYS}
        if sum(array.nbytes for array in arrays.values()) > MAX_BYTES:
            raise TrajectoryError(f"{path}: {self.t.size} samples are more than {MAX_BYTES} bytes")
        content = io.BytesIO()
        np.savez_compressed(
            content,
            format=np.array(_FORMAT),
            units=np.array(_UNITS),
            name=np.array(self.name),
            model_hash=np.array(self.model_hash),
            joint_names=np.array(self.joint_names, dtype=str),
            **arrays,
        )
        return write_whole(path, content.getvalue())

    @staticmethod
    def load(path: str | os.PathLike[str]) -> "Trajectory":
        """Read what `save` wrote, also with earlier versions. Nothing in the file is executed.

        Raises:
            TrajectoryError: the file is missing, no regular file, no trajectory, of an unknown version or in other
                units, or has arrays that do not fit or are larger than `MAX_BYTES`.
        """
        path = path_of(path, "path of a trajectory", error=TrajectoryError)
        try:
            with zipfile.ZipFile(io.BytesIO(read_bounded(path, MAX_BYTES + _HEADS))) as file:
                return _read(file)
        except FileError as error:
            raise TrajectoryError(str(error)) from None
        except TrajectoryError as error:
            raise TrajectoryError(f"{path}: {str(error)[:_LONGEST]}") from None
        except Exception as error:  # a damaged file sets off all that zipfile, zlib and numpy can raise
            raise TrajectoryError(f"{path}: not a readable npz trajectory ({str(error)[:_LONGEST]})") from None


def _read(file: zipfile.ZipFile) -> Trajectory:
    """A trajectory from its npz file."""
    found = file.namelist()
    if "format.npy" not in found:
        raise TrajectoryError(f"not a trajectory of format {_FORMAT}")
    if sum(info.file_size for info in file.infolist()) > MAX_BYTES + _HEADS:
        raise TrajectoryError(f"larger than {MAX_BYTES} bytes")
    form = str(_member(file, "format", text=True))
    if form not in (_FORMAT, _OLD_FORMAT):
        raise TrajectoryError(f"not a trajectory of format {_FORMAT} but {form[:80]!r}; a newer armdyn may read it")
    new = form == _FORMAT
    known = [f"{name}.npy" for name in (*_TEXTS, "joint_names", *_ARRAYS)]
    optional = () if new else ("model_hash.npy", "units.npy")
    if len(found) != len(set(found)) or not {*known} - {*optional} <= {*found} <= {*known}:
        raise TrajectoryError(f"not a readable npz trajectory: it holds {', '.join(map(repr, found[:12]))}")
    if new and (units := str(_member(file, "units", text=True))) != _UNITS:
        raise TrajectoryError(f"in units {units[:200]!r}; armdyn writes {_UNITS!r}")
    names = _member(file, "joint_names", text=True)
    if names.ndim != 1:
        raise TrajectoryError(f"joint_names has shape {names.shape}; expected (joints,)")
    if sum(_count(file, field) for field in _ARRAYS) * np.dtype(float).itemsize > MAX_BYTES:  # bytes become floats
        raise TrajectoryError(f"larger than {MAX_BYTES} bytes")
    return Trajectory(
        **{field: _member(file, field) for field in _ARRAYS},  # type: ignore[arg-type]  # refuses what is no number
        joint_names=tuple(map(str, names)),
        name=str(_member(file, "name", text=True)),
        model_hash=str(_member(file, "model_hash", text=True)) if new else "",
    )


def _count(file: zipfile.ZipFile, name: str, text: bool = False) -> int:
    """How many numbers or texts an array has, which are no more than fit into what the file says that it has."""
    info = file.getinfo(f"{name}.npy")
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):  # others may ask for gigabytes
        raise TrajectoryError(f"not a readable npz trajectory: {name} is compressed by another method than deflate")
    with file.open(info) as stream:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, dtype = read(stream)
    count = int(np.prod(shape, dtype=object)) if shape else 1
    if count * max(dtype.itemsize, 1) > info.file_size:  # numpy would make room for it before it reads
        raise TrajectoryError(f"not a readable npz trajectory: {name} of shape {shape} is cut off")
    if dtype.kind != ("U" if text else dtype.kind) or dtype.hasobject:
        raise TrajectoryError(f"not a readable npz trajectory: {name} is of type {dtype}")
    if text and info.file_size > _HEADS:
        raise TrajectoryError(f"not a readable npz trajectory: {name} is larger than {_HEADS} bytes")
    if text and name != "joint_names" and shape != ():
        raise TrajectoryError(f"not a readable npz trajectory: {name} has shape {shape}")
    return count


def _member(file: zipfile.ZipFile, name: str, text: bool = False) -> NDArray[np.generic]:
    """One array of an npz file: numbers or text, no larger than the file says that it is."""
    _count(file, name, text)
    with file.open(f"{name}.npy") as stream:
        array: NDArray[np.generic] = np.lib.format.read_array(stream, allow_pickle=False)
        stream.read()  # zipfile checks the checksum at the member's end
    if text:
        "".join(map(str, array.flat)).encode()  # half a surrogate pair could not be shown or written
    return array
