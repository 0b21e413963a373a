"""The command `armdyn replay`: writes a page in which the arm moves."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import armdyn as ad
from armdyn.cli.console import Answer, done, escape, working
from armdyn.cli.options.groups import argument, option
from armdyn.cli.options.results import OutputOptions
from armdyn.cli.options.robot import PayloadOptions, RobotArgument
from armdyn.errors import ArmdynWarning, TrajectoryError
from armdyn.parsing.numbers import number

if TYPE_CHECKING:
    from armdyn.cli.reports.saved import Saved


def replay(
    *,
    robot: RobotArgument,
    trajectories: list[Path] = argument(
        "RESULT",
        "Folders or trajectory.npz that mintime, pid or track wrote; or files of other planners, as optimality reads "
        "them.",
    ),
    payload: PayloadOptions,
    output: OutputOptions,
    slow_motion: Annotated[float | None, number] = option(
        "X", "Seconds shown per second of motion; by default it is chosen."
    ),
) -> Answer:
    """One self-contained HTML page in which the robot moves; several files move side by side.

    If a result.json lies next to a motion, the page shows its verdict, such as certified or not, and its obstacles
    around the arm.

    [dim]armdyn replay rr results/mintime-rr/trajectory.npz results/pid-rr/trajectory.npz --payload 0.1006[/]
    """
    from armdyn.cli.reports.subject import obstacles_in
    from armdyn.show.page.motions import ShownMotion
    from armdyn.show.replay import write_html

    arm = robot.read(payload.carried())
    saved = [_saved(path, arm) for path in trajectories]
    motions = [ShownMotion(one.motion.name or one.path.stem, one.motion, one.facts) for one in saved]
    obstacles = obstacles_in(saved[0].facts)
    folder = output.folder("replay", robot.robot, ["replay.html"])
    folder.mkdir(parents=True, exist_ok=True)
    with working(f"replay of {arm.name}"):
        page = write_html(arm, motions, folder / "replay.html", slow_motion=slow_motion, obstacles=obstacles)
    said = f"{escape(str(page))}  ({page.stat().st_size / 1e6:.1f} MB, opens in any browser)"
    return done("written", {}, said, files=[page])


def _saved(path: Path, arm: ad.Robot) -> Saved:
    """A result, or the motion of a file with its checks.

    Raises:
        ArmdynError: it cannot be read, or moves another number of joints.

    Warns:
        ArmdynWarning: the motion is another arm's.
    """
    from armdyn.cli.reports.saved import Saved, checked, is_given, motion_of, read_saved
    from armdyn.models.robots.loads import is_motion_of

    if is_given(path):
        motion = motion_of(arm, path)
        return Saved(path, motion, checked(arm, motion))
    saved = read_saved(path)
    if saved.motion.q.shape[1] != arm.nv:
        raise TrajectoryError(f"{path}: moves {saved.motion.q.shape[1]} joints, {arm.name} has {arm.nv}")
    if saved.motion.model_hashes and not is_motion_of(arm, saved.motion):
        warnings.warn(f"{path}: was computed for another arm, payload or friction", ArmdynWarning, stacklevel=2)
    return saved
