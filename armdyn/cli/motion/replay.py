"""The command that writes motions as a page in which the arm moves."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Annotated

import typer

import armdyn as ad
from armdyn.cli.console import answering, console, escape, working
from armdyn.cli.options.results import OutputOptions
from armdyn.cli.options.robot import PayloadOptions, RobotOptions
from armdyn.errors import ArmdynWarning, TrajectoryError
from armdyn.typed import number


def replay(
    robot: RobotOptions,
    trajectories: Annotated[list[Path], typer.Argument(metavar="FILE.npz…", help="What mintime and pid wrote.")],
    payload: PayloadOptions,
    output: OutputOptions,
    slow_motion: Annotated[
        str | None, typer.Option(metavar="X", help="Seconds shown per second of motion; by default it is chosen.")
    ] = None,
) -> None:
    """One self-contained HTML page in which the robot moves; several files move side by side.

    [dim]armdyn replay rr results/mintime-rr/trajectory.npz results/pid-rr/trajectory.npz --payload 0.1006[/]
    """
    with answering(output.json) as answer:
        from armdyn.show.replay import write_html

        arm = robot.read(payload.carried())
        motions = [_motion(path, arm) for path in trajectories]
        folder = output.folder("replay", robot.robot, ["replay.html"])
        slow = None if slow_motion is None else number(slow_motion, "--slow-motion")
        folder.mkdir(parents=True, exist_ok=True)
        with working(f"replay of {arm.name}", output.json):
            page = write_html(arm, motions, folder / "replay.html", slow_motion=slow)
        answer.facts |= {"success": True, "status": "written", "files": [str(page)]}
        if not output.json:
            console.print(f"{escape(str(page))}  ({page.stat().st_size / 1e6:.1f} MB, opens in any browser)")


def _motion(path: Path, arm: ad.Robot) -> ad.Trajectory:
    """The motion in a file.

    Raises:
        TrajectoryError: it cannot be read, or moves another number of joints.

    Warns:
        ArmdynWarning: it is another arm's.
    """
    motion = ad.Trajectory.load(path)
    if motion.q.shape[1] != arm.nv:
        raise TrajectoryError(f"{path}: moves {motion.q.shape[1]} joints, {arm.name} has {arm.nv}")
    if motion.model_hash not in ("", arm.model_hash):
        warnings.warn(f"{path}: was computed for another arm, payload or friction", ArmdynWarning, stacklevel=2)
    return motion
