"""File format of a trajectory: an npz of arrays and texts. Read without pickle, every size checked."""

import io
import os
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from armdyn.arguments import path_of
from armdyn.arrays import Array
from armdyn.errors import FileError, TrajectoryError
from armdyn.files import read_bounded, write_whole
from armdyn.trajectory.pieces import from_text

Made = TypeVar("Made")

_FORMAT = "armdyn-trajectory-3"
_UNITS = "t s; q rad or m; v rad/s or m/s; tau N m or N"
_ARRAYS = ("t", "q", "v", "tau")
_TEXTS = ("format", "units", "name", "model_hash", "hold", "pieces")

MAX_BYTES = 256 * 2**20
"""A trajectory whose arrays are larger is neither saved nor loaded [bytes]: 1.5 million samples of seven joints."""
MAX_NUMBER = 1e12
"""Largest number in a motion's file, in SI units: a larger position [rad] is known to 0.1 mrad at best, and computing
with 1e308 overflows."""

_HEADS = 2**20
"""Largest size of a file's texts and headers [bytes]."""

_LONGEST = 500
"""Characters of a message about a file: numpy quotes the content."""


def write(
    path: str | os.PathLike[str],
    arrays: Mapping[str, Array],
    texts: Mapping[str, str],
    joint_names: Sequence[str],
) -> Path:
    """Write a trajectory's arrays and texts to an npz file; see `Trajectory.save`."""
    path = path_of(path, "path of a trajectory", error=TrajectoryError)
    if sum(array.nbytes for array in arrays.values()) > MAX_BYTES:
        raise TrajectoryError(f"{path}: {arrays['t'].size} samples are more than {MAX_BYTES} bytes")
    said = {"format": _FORMAT, "units": _UNITS, **texts}
    members: dict[str, Any] = {name: np.array(text) for name, text in said.items()}
    if sum(member.nbytes for member in members.values()) > _HEADS // 2:
        raise TrajectoryError(f"{path}: names and pieces are more than {_HEADS // 2} bytes")
    content = io.BytesIO()
    np.savez_compressed(content, joint_names=np.array(joint_names, dtype=str), **members, **dict[str, Any](arrays))
    return write_whole(path, content.getvalue())


def read(path: str | os.PathLike[str], make: Callable[..., Made]) -> Made:
    """Read a file of `write`; see `Trajectory.load`.

    Args:
        path: the file.
        make: a trajectory, of its fields.
    """
    path = path_of(path, "path of a trajectory", error=TrajectoryError)
    with opened(path) as file:
        return _read(file, make)


@contextmanager
def opened(path: str | os.PathLike[str]) -> Iterator[zipfile.ZipFile]:
    """Open an untrusted npz file, and raise all its errors as one class, with its path.

    Raises:
        TrajectoryError: it cannot be read, is no npz file, or its arrays are larger than `MAX_BYTES`.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(read_bounded(path, MAX_BYTES + _HEADS))) as file:
            if sum(info.file_size for info in file.infolist()) > MAX_BYTES + _HEADS:
                raise TrajectoryError(f"larger than {MAX_BYTES} bytes")
            yield file
    except FileError as error:
        raise TrajectoryError(str(error)) from None
    except TrajectoryError as error:
        raise TrajectoryError(f"{path}: {str(error)[:_LONGEST]}") from None
    except zipfile.BadZipFile:
        raise TrajectoryError(f"{path}: not a readable npz trajectory (it is no .npz file, or is cut off)") from None
    except Exception as error:  # zipfile, zlib and numpy raise many classes on a damaged file
        raise TrajectoryError(f"{path}: not a readable npz trajectory ({str(error)[:_LONGEST]})") from None


def is_trajectory_file(path: str | os.PathLike[str]) -> bool:
    """Whether a file has the member names of `write`; its content is not checked."""
    try:
        with opened(path) as file:
            return "format.npy" in file.namelist()
    except Exception:  # no file, or none of these: its reader raises the error
        return False


def numbers_of(file: zipfile.ZipFile, name: str) -> Array:
    """One array of numbers of an untrusted npz file, no larger than the file says that it is.

    Raises:
        TrajectoryError: it is larger than `MAX_BYTES`, or not of numbers.
    """
    if _count(file, name) * np.dtype(float).itemsize > MAX_BYTES:
        raise TrajectoryError(f"{name} is larger than {MAX_BYTES} bytes")
    array = _member(file, name)
    if array.dtype.kind not in "iuf":
        raise TrajectoryError(f"{name} is of type {array.dtype}; it must be numbers")
    return array.astype(float)


def bounded(array: Array, name: str) -> Array:
    """A file's numbers, none of them larger than `MAX_NUMBER`.

    Args:
        array: its first axis the samples.
        name: of the array.

    Raises:
        TrajectoryError: one is larger; the trajectory's own checks refuse numbers that are not finite.
    """
    large = np.argwhere(np.isfinite(array) & (np.abs(array) > MAX_NUMBER))
    if large.size:
        value = array[tuple(large[0])]
        raise TrajectoryError(f"{name} is {value:g} in sample {large[0][0]}; the most is {MAX_NUMBER:g}")
    return array


def _read(file: zipfile.ZipFile, make: Callable[..., Made]) -> Made:
    """Read and check a trajectory from an open npz file."""
    found = file.namelist()
    if "format.npy" not in found:
        raise TrajectoryError(f"not a trajectory of format {_FORMAT}")
    form = str(_member(file, "format", text=True))
    if form != _FORMAT:
        raise TrajectoryError(f"not a trajectory of format {_FORMAT} but {form[:80]!r}; a newer armdyn may read it")
    arrays = (*_ARRAYS, "ends") if "ends.npy" in found else _ARRAYS
    if sorted(found) != sorted(f"{name}.npy" for name in (*_TEXTS, "joint_names", *arrays)):
        raise TrajectoryError(f"not a readable npz trajectory: it holds {', '.join(map(repr, found[:12]))}")
    if (units := str(_member(file, "units", text=True))) != _UNITS:
        raise TrajectoryError(f"in units {units[:200]!r}; armdyn writes {_UNITS!r}")
    names = _member(file, "joint_names", text=True)
    if sum(_count(file, field) for field in arrays) * np.dtype(float).itemsize > MAX_BYTES:  # bytes become floats
        raise TrajectoryError(f"larger than {MAX_BYTES} bytes")
    made = make(
        **{field: _member(file, field) for field in arrays},
        joint_names=tuple(map(str, names)),
        **{name: str(_member(file, name, text=True)) for name in ("name", "model_hash", "hold")},
        pieces=from_text(str(_member(file, "pieces", text=True))),
    )
    for field in arrays:
        bounded(getattr(made, field), field)
    return made


def _count(file: zipfile.ZipFile, name: str, text: bool = False) -> int:
    """Number of entries of an array, checked against the size of its member of the file."""
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
    if text and len(shape) != (name == "joint_names"):
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
