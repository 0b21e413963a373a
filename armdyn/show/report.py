"""What is left on disk of a run: trajectory, figure, replay and a summary, in one folder."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from armdyn.models.obstacles import Obstacle
from armdyn.models.robot import Robot
from armdyn.show.plots import plot_trajectories, save_figure
from armdyn.show.replay import write_html
from armdyn.show.results import save_result
from armdyn.trajectory import Trajectory


def write_run(
    folder: Path,
    robot: Robot,
    trajectory: Trajectory,
    summary: dict[str, object],
    title: str,
    obstacles: Sequence[Obstacle] = (),
) -> list[Path]:
    """Write trajectory.npz, figure.png, figure.pdf, replay.html and result.json.

    Args:
        folder: made if it is not there.
        robot: that moved.
        trajectory: its motion.
        summary: what result.json says, besides the files.
        title: of the figure.
        obstacles: drawn in the replay.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    trajectory = replace(trajectory, model_hash=robot.model_hash)
    files = [trajectory.save(folder / "trajectory.npz")]
    figure = plot_trajectories([trajectory], limits=robot.limits, title=title)
    files += [save_figure(figure, folder / f"figure.{suffix}") for suffix in ("png", "pdf")]
    files.append(write_html(robot, [trajectory], folder / "replay.html", obstacles=obstacles))
    result = folder / "result.json"
    names = [path.name for path in [*files, result]]
    return [*files, save_result(result, robot, {**summary, "files": names})]
