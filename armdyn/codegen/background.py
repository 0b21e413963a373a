"""Compilation in the background."""

import atexit
import os
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

_LONGEST = 90.0
"""Age of a mark [s] after which its builder is taken for dead: longer than a compiler may take."""

_awaited: set[Path] = set()
"""Libraries that this process has requested, or seen others build."""
_builders: list[tuple["subprocess.Popen[bytes]", int]] = []
"""Processes spawned by this one, and our ends of the pipes that close when this process ends."""


def build_later(library: Path, compiler: str, source: str) -> None:
    """Spawn a process that builds a library, and ends then.

    It may outlive this process where that ends by itself. Where this process is killed, or a solve is interrupted
    (`abandon`), it ends, too. One builder is enough: a mark next to the library shows that there is one.

    Args:
        library: its path, in a folder that is this user's alone.
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
        theirs, ours = os.pipe()
        # armdyn's own module, no shell; a session of its own receives no Ctrl-C.
        builder = subprocess.Popen(  # noqa: S603
            [sys.executable, "-m", "armdyn.codegen.builder", str(theirs)],
            stdin=file,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd="/",
            env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
            start_new_session=True,
            pass_fds=[theirs],
        )
    os.close(theirs)
    _builders.append((builder, ours))
    _awaited.add(library)


def abandon() -> None:
    """End the build under way, and its compiler."""
    while _builders:
        builder, line = _builders.pop()
        builder.terminate()
        os.close(line)


@atexit.register
def _leave() -> None:
    """Signal to builders that this process ends normally: they may continue."""
    for _, line in _builders:
        with suppress(OSError):  # it has ended
            os.write(line, b".")


def is_building() -> bool:
    """Whether a library is being built."""
    return bool(_awaited)


def arrived() -> bool:
    """Whether an awaited library has been built; it is then no longer awaited."""
    there = {library for library in _awaited if os.path.lexists(library)}
    _awaited.difference_update(there)
    return bool(there)
