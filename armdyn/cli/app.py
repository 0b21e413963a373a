"""The application: its commands.

The module of a command is imported for its options; the modules that do its work are imported when it runs.
"""

import shlex
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from armdyn import __version__
from armdyn.cli.console import EXIT_CODES
from armdyn.cli.execution import Followed
from armdyn.cli.options.groups import with_options

_HELP = """Time-optimal and closed-loop motion of robot arms, from a URDF.

[dim]The fastest motion of one of the paper's arms, with report, figures, numbers:[/]
    armdyn mintime rr --payload 0.1006
[dim]Your own arm, or one from the library; poses by name or in degrees:[/]
    armdyn mintime my_arm.urdf --q-start 0,0,0 --q-goal 1,0.5,-1.2
    armdyn mintime ur5 --q-start home --q-goal 90deg,-45deg,60deg,-90deg,0,0
[dim]A page in the browser where you drag start and goal:[/]
    armdyn studio panda
[dim]An example file of a pick-and-place cycle, and its fastest motion:[/]
    armdyn cycle --example
    armdyn cycle cell.toml
[dim]A sampled controller along the motion, on an arm with another payload than its model:[/]
    armdyn track rr --payload 0.1006 --reserve 0.1 --plant-payload 0.12
[dim]How much slower any planner's motion is than the fastest:[/]
    armdyn optimality panda planned.csv
[dim]Whether the robot's controller accepts it:[/]
    armdyn check planned.csv --preset franka-panda
[dim]The robot library; a check of your URDF:[/]
    armdyn robots
    armdyn doctor my_arm.urdf
[dim]Export for a robot or a simulator; JSON for a script:[/]
    armdyn export results/mintime-rr/trajectory.npz --rate 1000 --format ros2
    armdyn mintime rr --json

armdyn COMMAND --help says more, with examples."""

_PANELS = {
    "Motions": {
        "mintime": "motion.mintime",
        "studio": "studio",
        "cycle": "motion.cycle",
        "bound": "motion.bound",
        "optimality": "motion.optimality",
        "check": "motion.check",
        "sweep": "sweeps.sweep",
    },
    "Closed loops": {
        "track": "tracking.track",
        "monte-carlo": "tracking.many",
        "tune": "tracking.tuning",
        "pid": "motion.pid",
    },
    "Results": {
        "report": "reports.report",
        "compare": "reports.report",
        "replay": "reports.report",
        "export": "export",
    },
    "Robots": {"robots": "robots", "presets": "presets", "doctor": "doctor", "identify": "identify"},
    "The paper": {"reproduce": "paper", "urdf": "paper"},
}
"""Commands by panel of the help, each with its module."""


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


def application(only: str = "") -> typer.Typer:
    """The application with all commands, or with one: to import and declare all takes a fifth of a second.

    Args:
        only: name of a command.
    """
    app = typer.Typer(
        cls=CommandGroup,
        no_args_is_help=True,
        pretty_exceptions_enable=False,
        rich_markup_mode="rich",
        help=_HELP,
        epilog=f"Exit codes: {EXIT_CODES}",
    )
    app.callback()(_options)
    for panel, modules in _PANELS.items():
        for name, module in modules.items():
            if only in ("", name):
                command = getattr(import_module(f"armdyn.cli.{module}"), name.replace("-", "_"))
                app.command(cls=Command, rich_help_panel=panel)(with_options(command))
    return app


def only_command(words: Sequence[str]) -> str:
    """The command that a line needs alone; empty for lines without one, such as --help, and for lines of two.

    Args:
        words: of the line, without the program's name.
    """
    first = words[0] if words else ""
    known = any(first in modules for modules in _PANELS.values())
    return first if known and not any(word.startswith(THEN) for word in words) else ""


def _version(show: bool) -> None:
    if show:
        sys.stdout.write(f"armdyn {__version__}\n")
        raise typer.Exit


def _options(
    version: Annotated[
        bool, typer.Option("--version", metavar="", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass
