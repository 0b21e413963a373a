"""Table and figure of a sweep over payload."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from armdyn.files import csv_text, write_whole
from armdyn.show.results import save_results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from armdyn.models.robots.robot import Robot

_REACH = 0.3
"""A tangent goes this part of the way to the neighbouring payloads."""


def plot_sweep(rows: Sequence[dict[str, Any]], title: str | None = None) -> Figure:
    """Minimum time over payload, with the slope that each optimum's multipliers give.

    Args:
        rows: of increasing payloads, with the columns of sweep.csv; those that did not land are left out.
        title: above the axes.

    Returns:
        A figure of its own: pyplot knows nothing of it.
    """
    from matplotlib import rc_context

    from armdyn.show.figures.style import COLORS, LOOK, one_panel

    landed = [row for row in rows if row["success"]]
    grams = np.array([1e3 * row["payload_kg"] for row in landed])
    times = np.array([row["duration_s"] for row in landed])
    certified = np.array([row["certified"] for row in landed], dtype=bool)
    with rc_context(LOOK):
        figure, axes = one_panel(title, height=4.2)
        axes.plot(grams, times, color=COLORS[0], linewidth=1, alpha=0.5)
        for of, face, word in ((certified, COLORS[0], "certified"), (~certified, "white", "usable, not certified")):
            if np.any(of):
                axes.plot(grams[of], times[of], "o", color=COLORS[0], markerfacecolor=face, label=word, zorder=3)
        slope: str | None = r"slope $\partial t_f/\partial m$ of the multipliers"
        for k, row in enumerate(landed):
            if len(landed) < 2 or not row["certified"] or row["ms_per_gram"] is None:
                continue
            ends = _REACH * (np.array([grams[max(k - 1, 0)], grams[min(k + 1, len(landed) - 1)]]) - grams[k])
            rise = 1e-3 * row["ms_per_gram"] * ends
            axes.plot(grams[k] + ends, times[k] + rise, color=COLORS[1], linewidth=2, zorder=4, label=slope)
            slope = None
        axes.set(xlabel="payload [g]", ylabel="minimum time [s]")
        if landed:
            axes.legend(loc="upper left")
    return figure


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
