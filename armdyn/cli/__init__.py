"""The command line: `armdyn`.

Its import takes a few milliseconds: Ctrl-C and the streams are set up before anything large is imported.
"""

import gc
import sys

from armdyn.cli import interrupts

__all__ = ["main"]

_GARBAGE = 50_000
"""New objects between two garbage collections: most of a command's objects are imports, and stay. To look through
these again and again, and once more at the end, took a sixth of `armdyn mintime rr`."""


def main() -> None:
    """Run the command line; bad input, Ctrl-C and a closed pipe never end in a traceback.

    Raises:
        SystemExit: always, with the exit code.
    """
    gc.set_threshold(_GARBAGE)
    with interrupts.Guard():
        from armdyn.cli import streams

        streams.make_robust()
        try:
            from armdyn.cli.app import application, only_command

            application(only_command(sys.argv[1:]))()
        except SystemExit as end:
            gc.freeze()
            sys.exit(streams.flushed(end.code))
