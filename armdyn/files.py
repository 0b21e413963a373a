"""Files that are whole or not there, and files that are what was written or not read."""

import hashlib
import os
import stat
import tempfile
from contextlib import suppress
from pathlib import Path

_SEAL = hashlib.sha256().digest_size
"""Of a checksum [bytes]."""


def write_whole(path: str | os.PathLike[str], data: bytes) -> Path:
    """Write a file so that whoever reads it, even after a crash, finds the old one or the new one, whole.

    Returns:
        The path written, as given.

    Raises:
        OSError: the folder cannot be written.
    """
    path = Path(path)
    handle, scratch = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())  # or a crash may leave the new name on an empty file
        Path(scratch).chmod(0o644)
        Path(scratch).replace(path)
    except BaseException:
        Path(scratch).unlink(missing_ok=True)
        raise
    with suppress(OSError):  # some file systems cannot; the old file or the new one is whole without it
        _sync_folder(path.parent)
    return path


def write_sealed(path: str | os.PathLike[str], data: bytes) -> Path:
    """Write a file for `read_sealed`: `write_whole`, with a checksum of its name and data at its end.

    The checksum is in the same file, so that one rename puts both in their place: of two files, processes that write
    at the same time could leave one's data beside the other's checksum.
    """
    path = Path(path)
    return write_whole(path, data + _seal(path, data))


def read_sealed(path: str | os.PathLike[str], limit: int) -> bytes | None:
    """The data that `write_sealed` wrote under this name; None where there is anything else, or nothing.

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
