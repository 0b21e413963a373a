"""The command line: `armdyn`.

To import it takes a few milliseconds: what Ctrl-C and the streams need is settled before anything big is imported.
"""

import sys

from armdyn.cli import interrupts

__all__ = ["main"]


def main() -> None:
    """Run the command line; never ends in a traceback for bad input, Ctrl-C or a reader that has gone.

    Raises:
        SystemExit: always, with the exit code.
    """
    with interrupts.Guard():
        from armdyn.cli import streams

        streams.settle()
        try:
            from armdyn.cli.app import app

            app()
        except SystemExit as end:
            sys.exit(streams.flushed(end.code))
