"""Typer's runner rebuilds all commands for each run, which takes longer than most runs here."""

from functools import cache

import pytest
import typer.testing

from cli.command import run_json

typer.testing._get_command = cache(typer.testing._get_command)


@pytest.fixture(scope="session")
def listed():
    """JSON of `armdyn robots`, which reads 85 robots; not to be changed."""
    return run_json("robots")
