"""Files of a sweep over payload."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from armdyn.files import csv_text, write_whole
from armdyn.show.results import save_results

if TYPE_CHECKING:
    from armdyn.models.robots.robot import Robot


def write_sweep(
    folder: Path,
    robot: Robot,
    rows: Sequence[dict[str, Any]],
    motions: Sequence[Path],
    title: str,
    *,
    figure: bool = True,
) -> list[Path]:
    """Write table (CSV), figure and JSON of a sweep.

    Args:
        folder: of the files; it exists.
        robot: the arm.
        rows: one for each payload, increasing; at least one.
        motions: their files.
        title: the figure's.
        figure: whether there is one.

    Returns:
        All files, the motions first.

    Raises:
        OSError: the folder cannot be written.
    """
    table = csv_text([rows[0], *(row.values() for row in rows)])
    files = [*motions, write_whole(folder / "sweep.csv", table.encode())]
    if figure:
        from armdyn.show.figures.sweeps import plot_sweep
        from armdyn.show.plots import save_figures

        drawn = plot_sweep(rows, title)
        files += save_figures(drawn, folder / "figure", ("png", "pdf"))
    return save_results(folder, robot, {"rows": rows}, files)


def motion_name(payload: float) -> str:
    """File name of the motion with a payload [kg]."""
    return f"{1e3 * payload:g}g.npz"


def table_names(*, figure: bool) -> list[str]:
    """Names of the files that `write_sweep` writes."""
    return ["sweep.csv", *(["figure.png", "figure.pdf"] if figure else []), "result.json"]
