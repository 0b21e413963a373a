"""What is left on disk of a sweep over payloads: a table, a figure, and every motion."""

import csv
from collections.abc import Sequence
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure

from armdyn.files import write_whole
from armdyn.optimal import Solution
from armdyn.show.plots import COLORS, LOOK, save_figure
from armdyn.show.results import save_result

_REACH = 0.3
"""A tangent goes this part of the way to the neighbouring payloads."""


def sweep_row(payload: float, solution: Solution) -> dict[str, object]:
    """One line of the table: what is not known is None.

    Args:
        payload: that the arm carries [kg].
        solution: with it.
    """
    by = solution.sensitivities()
    most, saved = by.limited_most_by(solution.problem) if by else (None, None)
    return {
        "payload_kg": payload,
        "duration_s": solution.duration,
        "success": solution.success,
        "certified": solution.certificate.ok,
        "ms_per_gram": by.payload_mass if by else None,
        "limited_most_by": most,
        "ms_saved_by_one_per_cent": None if saved is None else 1e3 * saved,
        "solve_time_s": round(solution.solve_time, 3),
        "message": solution.message,
    }


def plot_sweep(payloads: Sequence[float], solutions: Sequence[Solution], title: str | None = None) -> Figure:
    """Minimum time over payload, with the slope that each optimum's multipliers give.

    Args:
        payloads: that the arm carries [kg], increasing.
        solutions: as many; those that did not land are left out.
        title: above the axes.

    Returns:
        A figure of its own: pyplot knows nothing of it.
    """
    landed = [(m, s) for m, s in zip(payloads, solutions, strict=True) if s.success]
    with rc_context(LOOK):
        figure = Figure(figsize=(7.0, 4.2), layout="constrained")
        axes = figure.subplots()
        masses = np.array([m for m, _ in landed])
        times = np.array([s.duration for _, s in landed])
        axes.plot(1e3 * masses, times, color=COLORS[0], linewidth=1, alpha=0.5)
        for certified, face, word in ((True, COLORS[0], "certified"), (False, "white", "landed, not certified")):
            of = np.array([s.certificate.ok is certified for _, s in landed], dtype=bool)
            if np.any(of):
                axes.plot(
                    1e3 * masses[of],
                    times[of],
                    "o",
                    color=COLORS[0],
                    markerfacecolor=face,
                    label=word,
                    zorder=3,
                )
        labelled = False
        for k, (mass, solution) in enumerate(landed):
            by = solution.sensitivities()
            if by is None or not solution.certificate.ok or len(landed) < 2:
                continue
            ends = np.array([masses[max(k - 1, 0)], masses[min(k + 1, len(masses) - 1)]]) - mass
            axes.plot(
                1e3 * (mass + _REACH * ends),
                solution.duration + by.payload_mass * _REACH * ends,
                color=COLORS[1],
                linewidth=2,
                zorder=4,
                label=None if labelled else r"slope $\partial t_f/\partial m$ of the multipliers",
            )
            labelled = True
        axes.set_xlabel("payload [g]")
        axes.set_ylabel("minimum time [s]")
        if landed:
            axes.legend(loc="upper left")
        if title:
            axes.set_title(title, fontsize=12, fontweight="bold")
    return figure


def write_sweep(folder: Path, payloads: Sequence[float], solutions: Sequence[Solution], title: str) -> list[Path]:
    """Table (CSV), figure, JSON, and every motion that landed, in one folder.

    Args:
        folder: made if it is not there.
        payloads: that the arm carries [kg], increasing.
        solutions: as many, at least one.
        title: the figure's.

    Returns:
        The files written.

    Raises:
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = [write_motion(folder, m, s) for m, s in zip(payloads, solutions, strict=True) if s.success]
    rows = [sweep_row(m, s) for m, s in zip(payloads, solutions, strict=True)]
    text = StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    files.append(write_whole(folder / "sweep.csv", text.getvalue().encode()))
    figure = plot_sweep(payloads, solutions, title)
    files += [save_figure(figure, folder / f"figure.{suffix}") for suffix in ("png", "pdf")]
    result = folder / "result.json"
    summary = {"rows": rows, "files": [path.name for path in [*files, result]]}
    return [*files, save_result(result, solutions[0].problem.robot, summary)]


def write_motion(folder: Path, payload: float, solution: Solution) -> Path:
    """One motion of a sweep, under its payload's name.

    Args:
        folder: that there is.
        payload: that the arm carries [kg].
        solution: with it.
    """
    motion = replace(solution.trajectory, model_hash=solution.problem.robot.model_hash)
    return motion.save(folder / f"{1e3 * payload:g}g.npz")
