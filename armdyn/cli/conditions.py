"""`--limit`: the conditions along the way that have a name of their own, read and written."""

from collections.abc import Sequence
from typing import Annotated

import typer
from rich.markup import escape

from armdyn.cli.arguments import numbers
from armdyn.errors import ProblemError
from armdyn.optimal import Solution
from armdyn.optimal.conditions.condition import Condition
from armdyn.optimal.conditions.registry import condition_named, options

Limits = Annotated[
    list[str] | None,
    typer.Option(
        "--limit",
        metavar="NAME=X[,X…][@FRAME]",
        help="A limit along the way; may be given again. "
        + escape("; ".join(f"{name}={kind.metavar}: {kind.help}" for name, kind in options().items()))
        + ".",
    ),
]


def limits_of(texts: Sequence[str] | None) -> list[Condition]:
    """Conditions as --limit says them.

    Raises:
        ProblemError: a text is none.
    """
    found = []
    for text in texts or ():
        name, equals, rest = text.partition("=")
        kind = condition_named(name.strip())
        values, at, frame = rest.partition("@")
        if not equals or (at and not frame.strip()):
            raise ProblemError(f"--limit {text!r}: write {name}={kind.metavar}, with numbers")
        found.append(kind.of_option(numbers(values, f"--limit {name}"), frame.strip() or None))
    return found


def limit_words(solution: Solution) -> dict[str, str]:
    """How near a motion comes to its limits along the way, for people."""
    return {kept.name: kept.said for kept in solution.kept if kept.share is not None}
