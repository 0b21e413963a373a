"""The application: its commands.

The module of a command is imported for its options; the modules that do its work are imported when it runs.
"""

import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Annotated

import typer

from armdyn import __version__
from armdyn.cli.console import EXIT_CODES
from armdyn.cli.layout import THEN, Command, CommandGroup
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
