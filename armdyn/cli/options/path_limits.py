"""`--limit`: the path constraints that have a name of their own."""

from __future__ import annotations

from typing import Annotated

import typer

from armdyn.cli.parsing.panels import LIMITS


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
