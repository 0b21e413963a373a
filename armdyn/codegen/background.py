"""Compilation in the background."""

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

_LONGEST = 90.0
"""After which a builder that has left its mark is taken for dead [s]: longer than a compiler may take."""

_awaited: set[Path] = set()
"""Libraries that this process has asked for, or seen others build."""


def build_later(library: Path, compiler: str, source: str) -> None:
    """Spawn a process that builds a library; it outlives this process and ends when the library is built.

    One builder is enough: a mark beside the library says that there is one.

    Args:
        library: where it is to be, in a folder that is this user's alone.
        compiler: its path.
        source: in C.

    Raises:
        OSError: the folder is full, say.
    """
    if library in _awaited:
        return
    mark = library.with_suffix(".building")
    try:
        if time.time() - mark.stat().st_mtime > _LONGEST:
            mark.unlink()
    except FileNotFoundError:
        pass
    try:
        os.close(os.open(mark, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o600))
    except FileExistsError:
        _awaited.add(library)
        return
    with tempfile.TemporaryFile() as file:
        file.write("\n".join((compiler, str(library), source)).encode())
        file.seek(0)
        # armdyn's own module, no shell; a session of its own hears no Ctrl-C.
        subprocess.Popen(
            [sys.executable, "-m", "armdyn.codegen.builder"],
            stdin=file,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd="/",
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            start_new_session=True,
        )
    _awaited.add(library)


def awaited() -> bool:
    """Whether a library is being built."""
    return bool(_awaited)


def arrived() -> bool:
    """Whether an awaited library has been built; it is then no longer awaited."""
    there = {library for library in _awaited if os.path.lexists(library)}
    _awaited.difference_update(there)
    return bool(there)
