"""`armdyn sweep ROBOT`: minimum times over payload, their table, figure and motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import Any

import armdyn as ad
from armdyn.cli import interrupts
from armdyn.cli.console import Answer, Shown, escape, interrupted, judged, table, working
from armdyn.cli.invocation import in_options
from armdyn.cli.motion.require import missing_of
from armdyn.cli.options.joints import reserve_words
from armdyn.cli.options.results import FigureOptions
from armdyn.files import csv_text, write_whole
from armdyn.optimal.answer.solution import reserve_summary
from armdyn.optimal.problem.status import stopping
from armdyn.reprs import percent
from armdyn.show.results import save_results
from armdyn.studies.continuation import chain
from armdyn.studies.executor import in_process
from armdyn.studies.rows import StudyRow, row_store
from armdyn.studies.run import CaseRun
from armdyn.studies.tasks.task import INTERRUPTED, CaseResult, motion_from

ROWS = "payloads.sqlite"
"""Rows, of a name of their own: those of other payloads are replaced, those of a study file in the same folder stay."""
_SAME = ("certified", "extremal", "gap", "gap_proven", "ms_per_gram", "limited_most_by", "ms_saved_by_one_per_cent")
"""Facts of the study's row that are columns of the table."""


def run_payloads(
    name: str,
    problems: Mapping[float, ad.MinimumTimeProblem],
    options: ad.MinimumTimeOptions,
    required: Mapping[str, float | None],
    results: FigureOptions,
) -> Answer:
    """Solve one motion with several payloads, unless done before, and write table, figure and motions.

    Args:
        name: of the robot, as it was given.
        problems: by payload [kg], increasing.
        options: of every search.
        required: of every motion, as of `requirements_of`.
        results: files that are written.
    """
    first = next(iter(problems.values()))
    arm, figure = first.robot, not results.no_figure
    files = [ROWS, *map(_motion_name, problems), "sweep.csv", *results.drawn("figure"), "result.json"]
    folder = results.output.folder("sweep", name, files)
    folder.mkdir(parents=True, exist_ok=True)
    with working(f"minimum times of {arm.name}") as progress:
        found, motions = _solved(folder, problems, options, progress)
        status = _status(found, len(problems))
        if not found:
            return interrupted()
        interrupts.saved(f"finished rows are in {folder}: the same command does the others")
        rows = [_line(row) for row in found]
        figure = figure and status != "interrupted"  # after Ctrl-C the user does not wait for it
        progress("writing the table and the figure" if figure else "writing the table")
        written = _write(folder, arm, rows, motions, figure=figure)
    missing = [
        f"{1e3 * row.settings['payload']:g} g: {text}"
        for row in found
        for text in missing_of(required, row.good, row.facts)
    ]
    facts = {
        "success": status == "done",
        "status": status,
        "robot": arm.name,
        "reserve": reserve_summary(first),
        "rows": rows,
        "missing": missing,
    }
    if status == "interrupted":
        facts["message"] = "interrupted"
    failing = ["some motions are not usable: their messages are in sweep.csv"] if status == "not_landed" else []
    kept = [f"{what}: {parts}" for what, parts in reserve_words(first).items()]
    shown: list[Shown] = [_table(arm.name, rows), *kept, f"results in {escape(str(folder))}"]
    remarks = [*failing, *(f"required: {escape(in_options(text))}" for text in missing)]
    return judged(facts, *shown, usable=status == "done", as_required=not missing, remarks=remarks, files=written)


def _solved(
    folder: Path, problems: Mapping[float, ad.MinimumTimeProblem], options: ad.MinimumTimeOptions, progress: Any
) -> tuple[list[StudyRow], list[Path]]:
    """Rows and files of motions, by payload; after Ctrl-C with the motion that was found so far."""
    files: dict[int, Path] = {}
    partial: dict[int, StudyRow] = {}
    robots = [one.robot for one in problems.values()]
    names = [_motion_name(mass) for mass in problems]

    def save(k: int, motion: ad.Trajectory) -> None:
        files[k] = replace(motion, model_hash=robots[k].model_hash).save(folder / names[k])

    def keep(row: StudyRow, result: CaseResult) -> None:
        if row.status == INTERRUPTED:
            partial[row.k] = row
        if result.value.success:
            save(row.k, result.value.trajectory)

    study = chain("payload", problems, options, lambda text: progress(f"{len(files) + 1} of {len(problems)}: {text}"))
    with row_store(folder / ROWS, study.description, replace=True) as rows, stopping(inf) as stop:
        with in_process(study.task) as executor:
            CaseRun(study, rows, executor, stop, ended=keep).go()
        found = partial | {row.k: row for row in rows.rows()}
        for k in rows.moved() - files.keys():  # of an earlier run
            save(k, replace(motion_from(rows.motion(k), robots[k]), name="minimum time"))
    return [found[k] for k in sorted(found)], [files[k] for k in sorted(files)]


def _line(row: StudyRow) -> dict[str, Any]:
    """One line of the table; None: not known."""
    facts = row.facts
    return {
        "payload_kg": row.settings["payload"],
        "duration_s": facts["duration_s"],
        "success": facts["landed"],
        "usable": row.good,
        **{name: facts[name] for name in _SAME},
        "solve_time_s": round(row.seconds, 3),
        "message": row.message,
    }


def _write(
    folder: Path, arm: ad.Robot, rows: Sequence[dict[str, Any]], files: Sequence[Path], *, figure: bool
) -> list[Path]:
    """Write sweep.csv, the figure and result.json next to the motions; returns all files, the motions first."""
    table = csv_text([rows[0], *(row.values() for row in rows)])
    files = [*files, write_whole(folder / "sweep.csv", table.encode())]
    if figure:
        from armdyn.show.figures.sweeps import plot_sweep
        from armdyn.show.plots import save_figures

        drawn = plot_sweep(rows, f"{arm.name}: minimum time over payload")
        files += save_figures(drawn, folder / "figure", ("png", "pdf"))
    return save_results(folder, arm, {"rows": rows}, files)


def _motion_name(payload: float) -> str:
    """File name of the motion with a payload [kg]."""
    return f"{1e3 * payload:g}g.npz"


def _status(found: Sequence[StudyRow], total: int) -> str:
    """Status of the sweep in a word."""
    if len(found) < total or any(row.status == "interrupted" for row in found):
        return "interrupted"
    return "done" if all(row.facts["landed"] for row in found) else "not_landed"


def _table(name: str, rows: Sequence[Mapping[str, Any]]) -> Shown:
    """Print the table."""
    cells = []
    for row in rows:
        gram, most, saved = row["ms_per_gram"], row["limited_most_by"], row["ms_saved_by_one_per_cent"]
        claims = ["locally"] * row["extremal"]
        claims += [f"within {percent(max(row['gap'], 0.0))}"] if row["gap_proven"] else []
        cells.append(
            (
                f"{1e3 * row['payload_kg']:g} g",
                f"{row['duration_s']:.6f} s" if row["success"] else "-",
                ", ".join(claims) or "not proven",
                "-" if gram is None else f"{gram:.3f} ms",
                "-" if most is None else str(most),
                "-" if saved is None else f"≤ {saved:.2f} ms",
            )
        )
    heads = (">payload", ">minimum time", "optimal", ">1 g costs", "limited most by", ">1 % saves")
    return table(f"{name}: minimum time over payload", heads, cells)
