"""Cache folders of machine code, and of other slow results, that only this user can write.

Libraries in the cache are loaded and run. A folder is therefore used only if it is this user's, no one else can write
in it, and no one else can put another in its place: the folders above it belong to this user or to root, and others
can write in none of them, or not rename files of others (the sticky bit, as of /tmp). Root is trusted.
"""

import hashlib
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import platformdirs

from armdyn.errors import ArmdynError, SettingError
from armdyn.files import read_sealed, write_sealed

_LARGEST = 2**24
"""Bytes of a stored result that are read at most."""


def cache_directory() -> Path:
    """Folder of the libraries: `ARMDYN_CACHE`, or the user's cache directory.

    Raises:
        SettingError: `ARMDYN_CACHE` is relative: it would depend on the working folder.
    """
    named = os.environ.get("ARMDYN_CACHE")
    if named and not Path(named).is_absolute():
        raise SettingError("ARMDYN_CACHE", named, "an absolute path")
    return Path(named or platformdirs.user_cache_dir("armdyn"))


def protected(folder: Path) -> Path:
    """The folder without links in its path; created if it is missing.

    Raises:
        OSError: it cannot be made, or others can change its content.
    """
    folder = Path(os.path.realpath(folder))
    for part in (*reversed(folder.parents), folder):
        if not part.exists():
            part.mkdir(mode=0o700, exist_ok=True)
        status, last = part.lstat(), part == folder
        if not stat.S_ISDIR(status.st_mode):
            raise NotADirectoryError(f"{part} is no folder")
        if status.st_uid != os.geteuid() and (last or status.st_uid != 0):
            raise PermissionError(f"{part} belongs to another user (number {status.st_uid})")
        if status.st_mode & 0o022 and (last or not status.st_mode & stat.S_ISVTX):
            raise PermissionError(f"others can write in {part}")
    return folder


def stored(kind: str, content: bytes, made: Callable[[], bytes]) -> bytes:
    """A result from the cache folder; else it is made, and stored there if the folder is protected.

    Args:
        kind: folder of such results.
        content: all that the result depends on.
        made: makes it.
    """
    try:
        place = protected(cache_directory() / kind) / hashlib.sha256(content).hexdigest()
    except (OSError, SettingError):
        return made()
    if (found := read_sealed(place, _LARGEST)) is None:
        found = made()
        with suppress(OSError, ArmdynError):  # a full disk
            write_sealed(place, found)
    return found


@contextmanager
def private_folder() -> Iterator[Path]:
    """Temporary folder that only this user can read.

    Raises:
        OSError: there is no place for one.
    """
    with tempfile.TemporaryDirectory(prefix="armdyn-", ignore_cleanup_errors=True) as folder:
        yield protected(Path(folder))
