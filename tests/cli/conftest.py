"""Typer's runner makes all commands anew whenever it runs one, which takes longer than most of what it runs here."""

from functools import cache

import typer.testing

typer.testing._get_command = cache(typer.testing._get_command)
