"""`--limit`: the path constraints that have a name of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from armdyn.cli.parsing.panels import LIMITS
from armdyn.errors import ProblemError
from armdyn.parsing.numbers import numbers

if TYPE_CHECKING:
    from armdyn.optimal.path_constraints.constraint import PathConstraint


def _explained(texts: list[str] | None) -> list[str] | None:
    """`--limit help` says which there are, and ends."""
    if "help" in (texts or ()):
        from armdyn.optimal.path_constraints.registry import options

        for name, kind in options().items():
            typer.echo(f"--limit {name}={kind.metavar}\n    {kind.help}")
        raise typer.Exit
    return texts


Limits = Annotated[
    list[str] | None,
    typer.Option(
        "--limit",
        metavar="NAME=X[,X…][@FRAME]",
        rich_help_panel=LIMITS,
        help="A limit along the way, such as tip-speed=0.25; --limit help lists them. May be given again.",
        callback=_explained,
    ),
]


def limits_of(texts: Sequence[str]) -> list[PathConstraint]:
    """Conditions as --limit says them.

    Raises:
        ProblemError: a text is none.
    """
    from armdyn.optimal.path_constraints.registry import path_constraint_named

    found = []
    for text in texts:
        name, equals, rest = text.partition("=")
        kind = path_constraint_named(name.strip())
        values, at, frame = rest.partition("@")
        if not equals or (at and not frame.strip()):
            raise ProblemError(f"--limit {text!r}: write {name}={kind.metavar}, with numbers")
        found.append(kind.of_option(numbers(values, f"--limit {name}"), frame.strip() or None))
    return found
