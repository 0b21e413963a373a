"""The command line: `armdyn`."""

from armdyn.cli.main import main

__all__ = ["main"]
