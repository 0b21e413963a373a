"""The application: its commands.

A command's module is read to know its options; what the command works with is imported when it runs.
"""

import sys
from typing import Annotated

import typer

from armdyn import __version__
from armdyn.cli.console import EXIT_CODES
from armdyn.cli.doctor import doctor
from armdyn.cli.export import export
from armdyn.cli.motion.bound import bound
from armdyn.cli.motion.mintime import mintime
from armdyn.cli.motion.pid import pid
from armdyn.cli.motion.replay import replay
from armdyn.cli.motion.sweep import sweep
from armdyn.cli.options.groups import with_options
from armdyn.cli.paper import reproduce, urdf
from armdyn.cli.reports.report import compare, report
from armdyn.cli.robots import robots
from armdyn.cli.tracking.track import track

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Time-optimal and closed-loop motion of robot arms, from a URDF.",
    epilog=f"Exit codes: {EXIT_CODES}",
)
for command in (mintime, bound, track, pid, reproduce, sweep, report, compare, replay, export, urdf, robots, doctor):
    app.command()(with_options(command))


def _version(wanted: bool) -> None:
    if wanted:
        sys.stdout.write(f"armdyn {__version__}\n")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", metavar="", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass
