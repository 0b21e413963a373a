"""The command `armdyn studio`: a page in the browser on which a motion is made by hand."""

from __future__ import annotations

import sys
import warnings
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING

import armdyn as ad
from armdyn.cli import interrupts
from armdyn.cli.console import Answer, console, facts_table, working, write_json
from armdyn.cli.invocation import option_value
from armdyn.cli.motion.mintime import CurveOptions
from armdyn.cli.options.groups import OUTPUT, TASK, flag, group, option
from armdyn.cli.options.poses import End, GoalOptions
from armdyn.cli.options.results import OutputOptions
from armdyn.cli.options.task import ProblemOptions
from armdyn.errors import ArmdynWarning, FileError, MissingPackageError

if TYPE_CHECKING:
    from pathlib import Path

    from armdyn.show.studio.session import SessionSetup
    from armdyn.show.studio.state import StudioState

_TURN, _SHIFT = 1.0, 0.2
"""Default travel of the first joint [rad, m]."""


@group()
class FirstPoses(GoalOptions):
    """Start and goal of a page that is opened; both have defaults, since they are changed there."""

    def default(self, which: End, robot: ad.Robot, name: str) -> list[float]:
        """Start: the first named pose, or the middle of the joints' ranges. Goal: the first joint turns, or slides."""
        lower, upper = robot.limits.position_lower, robot.limits.position_upper
        if which == "q_goal":
            q, way = self.end("q_start", robot, name), _SHIFT if robot.slides[0] else _TURN
            up, down = upper[0] - q[0], q[0] - lower[0]
            q[0] += min(way, up) if up >= min(way, down) else -min(way, down)
            return q
        import numpy as np

        named = [pose for pose in robot.poses.values() if np.all((lower <= pose) & (pose <= upper))]
        bounded = np.isfinite(lower + upper)
        middle = np.where(bounded, np.where(bounded, lower + upper, 0.0) / 2, np.clip(0.0, lower, upper))
        return [float(q) for q in (named[0] if named else middle)]


@group()
class FirstProblem(ProblemOptions):
    """The problem that a page begins with."""

    poses: FirstPoses


def studio(
    task: FirstProblem,
    search: CurveOptions,
    output: OutputOptions,
    host: str = option(
        "ADDRESS",
        "Address to serve on. Only this machine reaches 127.0.0.1; on another address everyone who reaches it can "
        "change the state, and save files into --out.",
        default="127.0.0.1",
        rich_help_panel=OUTPUT,
    ),
    port: int = option(
        "N", "Port; if it is taken, the next free.", default=8080, min=1, max=65535, rich_help_panel=OUTPUT
    ),
    fresh: bool = flag("Begin anew, though --out has the state of a last session.", rich_help_panel=TASK),
) -> Answer:
    """Page in the browser with the arm: drag start and goal, and see the fastest motion at once.

    Start and goal follow a gizmo at the tool, by inverse kinematics, or a slider for each joint. Obstacles are added,
    moved and removed; payload, reserve, calm and the controller's preset change what the arm can do. The motion is
    computed while you drag, the newest request first, and played, with its duration, the proven gap, the deciding
    limits, and the faults of a pose in words.

    The options are those of armdyn mintime, and the problem may be a file: its other conditions, such as via points,
    stay. Without --q-start and --q-goal the arm starts at its first named pose, and turns its first joint.

    Buttons save the problem (problem.toml, for armdyn mintime), the motion (trajectory.npz) and the report
    (report.html) into --out. The state is saved there all the time: a page that was killed resumes where it was, unless
    --fresh is given. Several browsers show the same. Ctrl-C ends it.

    It needs the package viser: pip install viser. No page leaves this machine, and nothing is loaded from another.

    [dim]armdyn studio panda
    armdyn studio ur5 --q-start home --self-collision
    armdyn studio my_arm.urdf --payload 2 --obstacle box:0.2,0.2,0.6@0.5,0,0.3
    armdyn studio problem.toml --port 9000 --out results/cell[/]
    """
    if find_spec("viser") is None:
        raise MissingPackageError("viser", "armdyn studio")
    from armdyn.show.studio.origins import free_port
    from armdyn.show.studio.session import MOTION_FILE, PROBLEM_FILE, REPORT_FILE, STATE_FILE, Session, SessionSetup
    from armdyn.show.studio.state import StudioState

    folder = output.folder("studio", task.robot.robot, (STATE_FILE, PROBLEM_FILE, MOTION_FILE, REPORT_FILE))
    with working(f"reading {task.robot.robot}"):
        problem = task.problem()
        setup = SessionSetup.of(problem, search.options(task.solver_options))
        kept = None if fresh else _kept_state(setup, folder)
        state = StudioState.of(problem, setup.options.calm) if kept is None else kept
        free = free_port(host, port)
    with Session(setup, folder, state) as session:
        from armdyn.show.studio.page import serve

        interrupts.set_step("the studio")
        serve(session, host, free, partial(_print_address, folder, host, port, kept is not None))
    return Answer()


def _kept_state(setup: SessionSetup, folder: Path) -> StudioState | None:
    """The state of the last session in a folder; None: missing, or unusable, with a warning."""
    from armdyn.show.studio.session import restored

    try:
        return restored(setup, folder)
    except FileError as error:
        warnings.warn(f"{error}; the studio begins anew, and the next change replaces it", ArmdynWarning, stacklevel=2)
        return None


def _print_address(folder: Path, host: str, requested: int, restored: bool, port: int) -> None:
    """Print the page's address."""
    from armdyn.show.studio.origins import is_loopback
    from armdyn.show.studio.session import STATE_FILE

    url = f"http://{f'[{host}]' if ':' in host else host}:{port}"
    if option_value("json"):
        facts = {"url": url, "host": host, "port": port, "folder": str(folder), "restored": restored}
        write_json({"success": True, "status": "serving", **facts})
        sys.stdout.flush()
    words = {"page": f"{url}  (Ctrl-C ends it)", "files": str(folder)}
    if port != requested:
        words["port"] = f"{requested} is taken"
    if restored:
        words["state"] = f"of the last session, from {folder / STATE_FILE}; --fresh begins anew"
    if not is_loopback(host):
        words["open to others"] = f"everyone who reaches {host} can use this page, and have files written into {folder}"
    console.print(facts_table("armdyn studio", words))
