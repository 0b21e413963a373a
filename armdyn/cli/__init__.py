"""The command line: `armdyn`.

Its import takes a few milliseconds: Ctrl-C and the streams are set up before anything large is imported.
"""

import sys

from armdyn.cli import interrupts

__all__ = ["main"]


def main() -> None:
    """Run the command line; bad input, Ctrl-C and a closed pipe never end in a traceback.

    Raises:
        SystemExit: always, with the exit code.
    """
    with interrupts.Guard():
        from armdyn.cli import streams

        streams.settle()
        try:
            from armdyn.cli.app import application, only_command

            application(only_command(sys.argv[1:]))()
        except SystemExit as end:
            sys.exit(streams.flushed(end.code))
