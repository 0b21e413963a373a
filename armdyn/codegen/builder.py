"""Process of `build_later`: it builds one library, puts it in its place, and ends."""

import os
import sys
from contextlib import suppress
from pathlib import Path

from armdyn.codegen.compiler import CompilerError, built
from armdyn.files import write_sealed

_NICE = 10
"""Niceness: solves go first."""


def main() -> None:
    """Compiler, library and source are on standard input, one after the other."""
    compiler, library, source = sys.stdin.read().split("\n", 2)
    place = Path(library)
    with suppress(OSError):
        os.nice(_NICE)
    try:
        with suppress(OSError, CompilerError):
            write_sealed(place, built(source, compiler, place.parent))
    finally:
        place.with_suffix(".building").unlink(missing_ok=True)


if __name__ == "__main__":
    main()
