"""The application and its entry point."""

import sys
from typing import Annotated

import typer

from armdyn.cli import doctor, motion, paper, robots, sweep

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help="Time-optimal and closed-loop motion of robot arms, from a URDF.",
    epilog="Exit codes: 0 done, 2 bad usage or input, 3 not converged or not landed, 130 interrupted.",
)
app.command()(motion.mintime)
app.command()(motion.pid)
app.command()(paper.reproduce)
app.command()(sweep.sweep)
app.command()(motion.replay)
app.command()(paper.urdf)
app.command()(robots.robots)
app.command()(doctor.doctor)


def _version(wanted: bool) -> None:
    if wanted:
        from armdyn import __version__

        sys.stdout.write(f"armdyn {__version__}\n")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command line; never ends in a traceback for bad input or Ctrl-C."""
    try:
        app()
    except KeyboardInterrupt:
        sys.exit(130)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of a pipe has gone: nothing left to say
        sys.exit(0)
