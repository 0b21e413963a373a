"""Typer's runner rebuilds all commands for each run, which takes longer than most runs here."""

from functools import cache

import typer.testing

typer.testing._get_command = cache(typer.testing._get_command)
