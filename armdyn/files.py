"""Bounded reading and atomic writing of files; files sealed by a checksum; values as JSON and CSV."""

import csv
import errno
import hashlib
import io
import json
import math
import os
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

from armdyn.arguments import path_of, shown
from armdyn.errors import ArmdynError, DiskFullError, FileError, ProblemError

_FULL = (errno.ENOSPC, errno.EDQUOT)
_PIECE = 2**20
written_folders: dict[Path, None] = {}
"""Folders of the files that `write_whole` has written in this process, for the message after Ctrl-C."""
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a named pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFLNK: "a symbolic link",
}


def is_full(error: OSError) -> bool:
    """Whether an error reports a full disk or an exhausted quota."""
    return error.errno in _FULL


def read_bounded(path: str | os.PathLike[str], most: int) -> bytes:
    """The bytes of a regular file; a pipe is not waited for, and a device not even opened.

    Args:
        path: the file, or a link to it.
        most: bytes that it may have.

    Raises:
        FileError: it is missing, no regular file, larger, or cannot be read.
    """
    try:
        path = path_of(path, "path")
    except ProblemError:
        raise FileError(shown(path), "cannot be read (it must be a path)") from None
    try:
        _refuse_irregular(path, Path(path).stat())
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC | os.O_NOCTTY)
        try:
            found = os.fstat(handle)
            _refuse_irregular(path, found)  # it may have become another one since
            if found.st_size > most:
                raise FileError(path, f"larger than {most} bytes")
            return _read(handle, path, most)
        finally:
            os.close(handle)
    except FileError:
        raise
    except FileNotFoundError:
        raise FileError(path, "no such file") from None
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror})") from None


def read_text(path: str | os.PathLike[str], most: int) -> str:
    """The text of a regular file in UTF-8, without a mark of byte order; else see `read_bounded`.

    Raises:
        FileError: as of `read_bounded`, or it is not UTF-8.
    """
    try:
        return read_bounded(path, most).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError(path, f"not UTF-8 (byte {error.start})") from None


def _refuse_irregular(path: str | os.PathLike[str], found: os.stat_result, verb: str = "read") -> None:
    if not stat.S_ISREG(found.st_mode):
        kind = _KINDS.get(stat.S_IFMT(found.st_mode), "no file")
        raise FileError(path, f"cannot be {verb} (it is {kind}; give the path of a regular file)")


def refuse_replacing(path: str | os.PathLike[str]) -> None:
    """Refuse a path at which there is anything but a regular file: no device, pipe, folder or link is ever replaced.

    Links are not followed either: a file that a link points at may be in a store of files that never change (DVC,
    git-annex), or another user's choice.

    Raises:
        FileError: there is something else.
    """
    with suppress(FileNotFoundError):
        _refuse_irregular(path, os.lstat(path), "written")


def _read(handle: int, path: str | os.PathLike[str], most: int) -> bytes:
    content = io.BytesIO()  # whose value is no copy
    while piece := os.read(handle, _PIECE):
        content.write(piece)
        if content.tell() > most:  # it grows, or its file system reports no sizes
            raise FileError(path, f"larger than {most} bytes")
    return content.getvalue()


def file_inside(folder: str | os.PathLike[str], name: object) -> Path:
    """The file that an untrusted file names, relative to its own folder; links must not lead out of it.

    Raises:
        FileError: the file is missing, or outside the folder.
    """
    found = place_inside(folder, name)
    if os.path.isfile(found):  # noqa: PTH113  # False for a name that is too long
        return found
    raise FileError(shown(name), f"no file inside {os.path.realpath(folder)}")


def place_inside(folder: str | os.PathLike[str], name: object) -> Path:
    """Path of `file_inside`, also where there is no file.

    Raises:
        FileError: it is not inside.
    """
    home = Path(os.path.realpath(folder))
    try:
        found = Path(os.path.realpath(home / path_of(name, "file")))
    except (OSError, ValueError):  # a null character, a loop of links
        raise FileError(shown(name), "is no path of a file") from None
    if not found.is_relative_to(home):
        raise FileError(shown(name), f"is outside the folder {home}: it must be inside")
    return found


def read_json(path: str | os.PathLike[str], most: int) -> object:
    """Read a JSON file. Its numbers are finite and fit a float; its texts can be written again.

    Args:
        path: the file.
        most: bytes that it may have.

    Raises:
        FileError: as of `read_bounded`, or it is no such JSON.
    """
    data = read_bounded(path, most)
    try:
        return parse_json(data)
    except ValueError as error:
        raise FileError(path, f"not JSON ({error})") from None


def parse_json(data: str | bytes) -> object:
    """JSON as of `read_json`.

    Raises:
        ValueError: it is no such JSON.
    """
    try:
        content: object = json.loads(data, parse_constant=_refuse, parse_float=_finite, parse_int=_whole)
        json.dumps(content, ensure_ascii=False).encode()  # half a surrogate pair cannot be shown or saved
    except (RecursionError, MemoryError) as error:
        raise ValueError(str(error)) from None
    return content


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant[:80]} is not finite")


def _finite(text: str) -> float:
    number = float(text)
    return number if abs(number) < float("inf") else _refuse(text)


def _whole(text: str) -> int:
    _finite(text)
    return int(text)


def as_json(value: Any) -> Any:
    """A number, text, None, array, or lists and tables of these as JSON values: null for infinite numbers and NaN."""
    value = value.tolist() if hasattr(value, "tolist") else value  # numpy's
    if isinstance(value, Mapping):
        return {key: as_json(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [as_json(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def attributes(value: object, *names: str) -> dict[str, Any]:
    """Some attributes of a value, by their names, `as_json`."""
    return {name: as_json(getattr(value, name)) for name in names}


def csv_text(rows: Iterable[Iterable[object]]) -> str:
    """Format rows as CSV: floats with the shortest exact digits, None as an empty cell."""
    content = io.StringIO(newline="")
    csv.writer(content, lineterminator="\n").writerows(rows)
    return content.getvalue()


_SEAL = hashlib.sha256().digest_size
"""Length of a checksum [bytes]."""


def write_whole(path: str | os.PathLike[str], data: bytes) -> Path:
    """Write a file atomically: readers find the old one or the new one, whole, even after a crash.

    Returns:
        The path written, as given.

    Raises:
        DiskFullError: there is no room for it.
        FileError: the folder cannot be written, or there is a device, pipe, folder or link in the file's place.
    """
    path = Path(path_of(path, "path"))
    with writing_whole(path) as scratch:
        scratch.write_bytes(data)
    written_folders[path.parent] = None
    return path


@contextmanager
def writing_whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A scratch file that takes the place of a file when it is written; see `write_whole`."""
    path = Path(path_of(path, "path"))
    with _naming_unwritten_file(path):
        refuse_replacing(path)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        scratch = Path(name)
        try:
            yield scratch
            os.fsync(handle)  # or a crash may leave the new name on an empty file
            scratch.chmod(0o644)
            scratch.replace(path)
        except BaseException:
            scratch.unlink(missing_ok=True)
            raise
        finally:
            os.close(handle)
    with suppress(OSError):  # some file systems cannot; the old file or the new one is whole without it
        _sync_folder(path.parent)


def probe_folder(folder: str | os.PathLike[str], *names: str) -> Path:
    """Check that a folder is writable, before a long computation. Leaves nothing behind.

    Args:
        folder: which there may not be yet.
        names: of the files that are to be written there.

    Returns:
        The folder.

    Raises:
        DiskFullError: there is no room for a single byte.
        FileError: it is no folder and cannot become one, it cannot be written, or such a name is no regular file's.
    """
    folder = Path(folder)
    made = [one for one in (folder, *folder.parents) if not os.path.lexists(one)]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=folder, prefix=".probe.", buffering=0) as file:
            file.write(b"?")
        for name in names:
            refuse_replacing(folder / name)
    except FileError:
        raise
    except (FileExistsError, NotADirectoryError):
        raise FileError(folder, "cannot be written to (a file is in the way; give a folder)") from None
    except (OSError, ValueError) as error:
        if isinstance(error, OSError) and is_full(error):
            raise DiskFullError(folder) from error
        reason = error.strerror if isinstance(error, OSError) else error
        raise FileError(folder, f"cannot be written to ({reason}); give a folder that can") from None
    finally:
        for one in made:
            with suppress(OSError, ValueError):
                one.rmdir()
    return folder


@contextmanager
def _naming_unwritten_file(path: Path) -> Iterator[None]:
    """Context that turns the system's errors into armdyn's, with the path of the file that is written.

    Raises:
        DiskFullError: there is no room for it.
        FileError: it cannot be written.
    """
    try:
        yield
    except ArmdynError:
        raise
    except OSError as error:
        if is_full(error):
            raise DiskFullError(path) from error
        # No such folder, no right to it, a name too long.
        raise FileError(path, f"cannot be written ({error.strerror or error})") from error


def write_sealed(path: str | os.PathLike[str], data: bytes) -> Path:
    """Write a file for `read_sealed`: `write_whole`, with a checksum of its name and data at its end.

    The checksum is in the same file, so that one rename puts both in their place: of two files, processes that write
    at the same time could leave one's data with the other's checksum. Of the folder's own names nothing else is kept:
    a pipe or a link is replaced, as a damaged file is.
    """
    path = Path(path)
    with suppress(OSError):
        if not stat.S_ISREG(path.lstat().st_mode):
            path.unlink()
    with writing_whole(path) as scratch:
        scratch.write_bytes(data + _seal(path, data))
    return path


def read_sealed(path: str | os.PathLike[str], limit: int) -> bytes | None:
    """Read data written by `write_sealed`; None if the file is missing, damaged or another one.

    Anything else: no regular file, a link, another user's file, one that others can write, one that cannot be read, is
    too long, has another name than it was written under, or is damaged. It never waits, as for a pipe's other end.

    Args:
        path: where.
        limit: the most that is read [bytes].
    """
    path = Path(path)
    try:
        handle = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    except OSError:
        return None
    try:
        status = os.fstat(handle)
        ours = status.st_uid == os.geteuid() and not status.st_mode & 0o022
        if not (ours and stat.S_ISREG(status.st_mode) and status.st_size <= limit + _SEAL):
            return None
        with open(handle, "rb", closefd=False) as file:
            content = file.read(limit + _SEAL)
    except OSError:
        return None
    finally:
        os.close(handle)
    data, seal = content[:-_SEAL], content[-_SEAL:]
    return data if seal == _seal(path, data) else None


def _seal(path: Path, data: bytes) -> bytes:
    return hashlib.sha256(os.fsencode(path.name) + b"\0" + data).digest()


def _sync_folder(folder: Path) -> None:
    """The folder's entries reach the disk, or a crash may take a rename back."""
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
