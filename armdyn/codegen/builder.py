"""Process of `build_later`: it builds one library, puts it in its place, and ends."""

import os
import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path

from armdyn.codegen.compiler import CompilerError, built
from armdyn.files import write_sealed

_NICE = 10
"""Niceness: solves go first."""


def main() -> None:
    """Build a library; compiler, library and source are on standard input, the owner's pipe is the argument."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(1))  # runs all cleanup
    for line in sys.argv[1:]:
        threading.Thread(target=_end_with_owner, args=(int(line),), daemon=True).start()
    compiler, library, source = sys.stdin.read().split("\n", 2)
    place = Path(library)
    with suppress(OSError):
        os.nice(_NICE)
    try:
        with suppress(OSError, CompilerError):
            write_sealed(place, built(source, compiler, place.parent))
    finally:
        place.with_suffix(".building").unlink(missing_ok=True)


def _end_with_owner(line: int) -> None:
    """End once the owner was killed: its end of the pipe closes without a message."""
    if not os.read(line, 1):
        os.kill(os.getpid(), signal.SIGTERM)


if __name__ == "__main__":
    main()
