"""Options that every command has where they mean something: --quiet, --degrees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from inspect import Parameter
from typing import Annotated, Any

import typer

from armdyn.cli.console import speaking
from armdyn.cli.parsing.panels import OUTPUT, TASK
from armdyn.cli.parsing.positions import reading_degrees

ANGLES = ("q_start", "q_goal", "via", "lock")
"""Options whose numbers are positions of joints: all that --degrees is about."""


def everywhere(own: Mapping[str, object]) -> Iterator[Parameter]:
    """The options that a command has besides its own.

    Args:
        own: its own, by name; looked at when all of them are there.
    """
    angles = [f"--{name.replace('_', '-')}" for name in ANGLES if name in own]
    if angles:
        told = f"Numbers of {', '.join(angles)} are degrees, but for joints that slide and numbers with a unit or pi."
        yield _flag("degrees", f"{told} All other options stay as they are.", TASK)
    yield _flag("quiet", "Say nothing but errors and warnings; the exit code tells, and files are written.", OUTPUT)


@contextmanager
def heeding(command: str, values: dict[str, Any]) -> Iterator[None]:
    """What these options ask for, while a command works.

    Args:
        command: its name, as Python has it.
        values: of all options; those of this module are as they are typed.
    """
    with speaking(command.replace("_", "-"), quiet=values["quiet"]), reading_degrees(values.get("degrees", False)):
        yield


def _flag(name: str, about: str, panel: str) -> Parameter:
    hint = Annotated[bool, typer.Option(f"--{name}", metavar="", help=about, rich_help_panel=panel)]
    return Parameter(name, Parameter.KEYWORD_ONLY, default=False, annotation=hint)
