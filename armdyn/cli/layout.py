"""Commands of the application: a line may have two of them, and help is a page of `help_page`."""

import shlex
from typing import Any

from typer.core import TyperCommand, TyperGroup

from armdyn.cli.execution import Followed

THEN = "--then"
"""Option whose value is the rest of the line: another command, see `identify`."""

_BARE = str.maketrans("", "", "{}")
"""Typer writes {ROBOT} of an argument."""


class Command(TyperCommand):
    """A command whose help has no narrow columns: the description of an option with a long name is below the name."""

    def format_help(self, ctx: Any, formatter: Any) -> None:  # click's
        """Print help."""
        from armdyn.cli.help_page import print_command_help  # rich takes time to load

        print_command_help(self, ctx)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        """Words of the usage line, which help and errors begin with."""
        return [piece.translate(_BARE) for piece in super().collect_usage_pieces(ctx)]

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the command's own words: all that follows --then is another command's, one value."""
        at = args.index(THEN) + 1 if THEN in args else len(args)
        own = [*args[:at], shlex.join(args[at:])] if at + 1 < len(args) else args
        left = super().parse_args(ctx, own)
        if ctx.params.get("then") is not None:
            _parse_then(ctx)
        return left

    def invoke(self, ctx: Any) -> Any:
        """Run the command, and the one that it is to be followed by."""
        try:
            return super().invoke(ctx)
        except Followed as end:
            ctx.find_root().command.main(end.words, prog_name="armdyn")


def _parse_then(ctx: Any) -> None:
    """Parse the command after --then before the first one runs, with a placeholder for its robot."""
    try:
        words = shlex.split(ctx.params["then"])
    except ValueError as error:
        ctx.fail(f"{THEN}: {error}")
    group = ctx.find_root().command
    name, command, rest = group.resolve_command(ctx, words or [""])
    command.make_context(name, ["ROBOT", *rest], parent=ctx.find_root())


class CommandGroup(TyperGroup):
    """The application, whose help has examples, options, and commands by purpose."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Print help."""
        from armdyn.cli.help_page import print_application_help

        print_application_help(self, ctx)
