"""Files of a run: trajectory, figure, report and summary, in one folder.

A figure takes matplotlib and a report meshcat: each is loaded when it is drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from armdyn.arguments import listener
from armdyn.models.scene.obstacles import obstacle_entry
from armdyn.show.results import result_head, save_results

if TYPE_CHECKING:
    from armdyn.models.robots.robot import Robot
    from armdyn.models.scene.obstacles import Obstacle
    from armdyn.trajectory import Trajectory

Part = Literal["figure", "report"]
PARTS: tuple[Part, ...] = ("figure", "report")
"""Drawings of a motion."""


def file_names(parts: Collection[Part] = PARTS, motions: Iterable[str] = ("trajectory",)) -> list[str]:
    """The files that `write_run` writes."""
    drawn = {"figure": ["figure.png", "figure.pdf"], "report": ["report.html"]}
    saved = [f"{name}.npz" for name in motions]
    return [*saved, *(name for part in PARTS if part in parts for name in drawn[part]), "result.json"]


def write_run(
    folder: Path,
    robot: Robot,
    motions: Mapping[str, Trajectory],
    summary: dict[str, object],
    title: str,
    obstacles: Sequence[Obstacle] = (),
    *,
    parts: Collection[Part] = PARTS,
    progress: Callable[[str], None] | None = None,
) -> list[Path]:
    """Write the motions (trajectory.npz), figure.png, figure.pdf, report.html and result.json.

    Args:
        folder: made if it is not there.
        robot: that moved.
        motions: its motions by the names of their files; drawn together.
        summary: facts of result.json, besides the files.
        title: of the figure and the report.
        obstacles: drawn in the report, and said in result.json.
        parts: the drawings.
        progress: called with the name of the current step.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be written.
    """
    progress = listener(progress)
    folder.mkdir(parents=True, exist_ok=True)
    own = {
        # A controller's reference was made for its own model of the arm.
        name: motion if name == "reference" and motion.model_hash else replace(motion, model_hash=robot.model_hash)
        for name, motion in motions.items()
    }
    scene = {"obstacles": [obstacle_entry(each) for each in obstacles]} if obstacles else {}
    facts = {"title": title, **summary, **scene}
    files = [motion.save(folder / f"{name}.npz") for name, motion in own.items()]
    save_results(folder, robot, facts, files)  # complete if Ctrl-C ends the drawing
    if "figure" in parts:
        progress("drawing the figure")
        from armdyn.show.plots import plot_trajectories, save_figures

        # The summary of a minimum-time solution whose arcs are not resolved has an empty list of arcs.
        unresolved = (0,) if summary.get("arcs") == [] else ()
        figure = plot_trajectories(list(own.values()), limits=robot.limits, title=title, unresolved=unresolved)
        files += save_figures(figure, folder / "figure", ("png", "pdf"))
    if "report" in parts:
        progress("writing the report")
        files.append(write_report(folder / "report.html", robot, motions, summary, title, obstacles))
    return save_results(folder, robot, facts, files)


def write_report(
    path: Path,
    robot: Robot,
    motions: Mapping[str, Trajectory],
    summary: Mapping[str, object],
    title: str,
    obstacles: Sequence[Obstacle],
) -> Path:
    """Write the page of a run; see `write_run`. Its first motion is judged, the others are its ghosts.

    Raises:
        FileError: the folder cannot be written.
    """
    from armdyn.show.page.facts import Facts
    from armdyn.show.page.motions import ShownMotion, Subject
    from armdyn.show.page.report import report_of, write_page

    moves = [ShownMotion(motion.name or name, motion, Facts()) for name, motion in motions.items()]
    moves[0] = replace(moves[0], facts=Facts({**result_head(robot), **summary}))
    return write_page(path, report_of(Subject.of(robot, obstacles), moves, title))
