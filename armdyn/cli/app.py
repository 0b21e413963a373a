"""The application: its commands.

The module of a command is imported for its options; the modules that do its work are imported when it runs.
"""

import sys
from collections.abc import Callable
from typing import Annotated

import typer

from armdyn import __version__
from armdyn.cli.console import EXIT_CODES
from armdyn.cli.doctor import doctor
from armdyn.cli.export import export
from armdyn.cli.identify import identify
from armdyn.cli.layout import Command, CommandGroup
from armdyn.cli.motion.bound import bound
from armdyn.cli.motion.check import check
from armdyn.cli.motion.cycle import cycle
from armdyn.cli.motion.mintime import mintime
from armdyn.cli.motion.optimality import optimality
from armdyn.cli.motion.pid import pid
from armdyn.cli.motion.replay import replay
from armdyn.cli.options.groups import with_options
from armdyn.cli.paper import reproduce, urdf
from armdyn.cli.presets import presets
from armdyn.cli.reports.report import compare, report
from armdyn.cli.robots import robots
from armdyn.cli.studio import studio
from armdyn.cli.sweeps.sweep import sweep
from armdyn.cli.tracking.many import monte_carlo
from armdyn.cli.tracking.track import track
from armdyn.cli.tracking.tuning import tune

_HELP = """Time-optimal and closed-loop motion of robot arms, from a URDF.

[dim]The fastest motion of an arm of the paper's, as a report, figures, numbers:[/]
    armdyn mintime rr --payload 0.1006
[dim]Of your own arm, or of one that has a name; poses by name or in degrees:[/]
    armdyn mintime my_arm.urdf --q-start 0,0,0 --q-goal 1,0.5,-1.2
    armdyn mintime ur5 --q-start home --q-goal 90deg,-45deg,60deg,-90deg,0,0
[dim]A page in the browser, on which you drag start and goal:[/]
    armdyn studio panda
[dim]A pick-and-place cycle from a file, and a file to begin with:[/]
    armdyn cycle --example
    armdyn cycle cell.toml
[dim]A controller along the motion, sampled, on an arm with another payload than its model:[/]
    armdyn track rr --payload 0.1006 --reserve 0.1 --plant-payload 0.12
[dim]How much time any planner's motion leaves:[/]
    armdyn optimality panda planned.csv
[dim]Whether the robot's controller accepts it:[/]
    armdyn check planned.csv --preset franka-panda
[dim]The arms that have a name; a check of your URDF:[/]
    armdyn robots
    armdyn doctor my_arm.urdf
[dim]For a robot or a simulator; for a script:[/]
    armdyn export results/mintime-rr/trajectory.npz --rate 1000 --format ros2
    armdyn mintime rr --json

armdyn COMMAND --help says more, with examples."""

_PANELS: dict[str, tuple[Callable[..., None], ...]] = {
    "Motions": (mintime, studio, cycle, bound, optimality, check, sweep),
    "Closed loops": (track, monte_carlo, tune, pid),
    "Results": (report, compare, replay, export),
    "Robots": (robots, presets, doctor, identify),
    "The paper": (reproduce, urdf),
}

app = typer.Typer(
    cls=CommandGroup,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    help=_HELP,
    epilog=f"Exit codes: {EXIT_CODES}",
)
for panel, commands in _PANELS.items():
    for command in commands:
        app.command(cls=Command, rich_help_panel=panel)(with_options(command))


def _version(show: bool) -> None:
    if show:
        sys.stdout.write(f"armdyn {__version__}\n")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", metavar="", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass
