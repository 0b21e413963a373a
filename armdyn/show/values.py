"""Renderer of values: notebook cards, figures and reports; registered in `armdyn.rendering`."""

from __future__ import annotations

import os
from pathlib import Path

from matplotlib.figure import Figure

from armdyn.arguments import path as path_of
from armdyn.optimal.answer.solution import Solution
from armdyn.optimal.answer.summary import minimum_time_summary
from armdyn.show.cards import card as card
from armdyn.show.plots import plot_trajectories
from armdyn.show.report import write_report


def figure(solution: Solution) -> Figure:
    """See `Solution.plot`."""
    limits, unresolved = solution.problem.limits, () if solution.arcs else (0,)
    return plot_trajectories([solution.trajectory], limits=limits, title=_title(solution), unresolved=unresolved)


def report(solution: Solution, path: str | os.PathLike[str]) -> Path:
    """See `Solution.report`."""
    problem, file = solution.problem, Path(path_of(path, "path"))
    motions, summary = {"minimum time": solution.trajectory}, minimum_time_summary(solution)
    return write_report(file, problem.robot, motions, summary, _title(solution), problem.obstacles)


def _title(solution: Solution) -> str:
    return f"{solution.problem.robot.name}: minimum time"
