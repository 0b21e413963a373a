"""`armdyn sweep STUDY.toml`: the cases of a study file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import armdyn as ad
from armdyn.cli import interrupts
from armdyn.cli.console import Answer, facts_table, judged, progress_bar
from armdyn.cli.options.groups import flag, group, option
from armdyn.cli.options.results import FigureOptions
from armdyn.errors import ProblemError

if TYPE_CHECKING:
    from armdyn.studies.executor import ExecutorOf
    from armdyn.studies.run import Progress, StudyRun
    from armdyn.studies.study import Study

ROWS = "study.sqlite"
FIGURES = ("curve", "map", "pareto")
_ANSWERS = {"usable", "settled", "not_settled", "diverged", "failed", "done"}
"""Statuses of completed cases: an arm that does not settle is a result."""
_MOST_DRAWN = 100_000
"""Rows of a figure, at most."""


@group("Study file")
class StudyOptions:
    """Executor of a study file's cases, and storage of its rows."""

    workers: int | None = option("N", "Processes on this machine; by default one per core.", min=1)
    scheduler: str | None = option("HOST:PORT", "A Dask cluster's scheduler: its workers do the cases instead.")
    again: bool = flag("Do cases once more whose workers died, or that ended in an error.")
    sync: Literal["full", "normal"] = option(
        "MODE", "full: a row survives a power cut, too; normal: only that armdyn is killed, but faster.", default="full"
    )
    parquet: bool = flag("Write rows.parquet, too (needs pyarrow).")

    def executor(self) -> ExecutorOf:
        """The executor of the cases.

        Raises:
            ProblemError: the scheduler's address is malformed, or workers are given, too.
        """
        from armdyn.studies.executor import local_executor

        if self.scheduler is None:
            return partial(local_executor, workers=self.workers)
        if self.workers is not None:
            raise ProblemError("--workers are processes of this machine; a --scheduler has its own")
        return ad.dask_executor(self.scheduler)


def run_file(path: str, options: StudyOptions, results: FigureOptions) -> Answer:
    """Run a study's missing cases, and write tables and figures of all cases.

    Args:
        path: of the study.
        options: the executor.
        results: files that are written.

    Raises:
        ArmdynError: it is no study, or cannot be done.
    """
    from armdyn.studies.rows import read_rows
    from armdyn.studies.tables import flat, write_csv, write_parquet

    study, executor = ad.read_study(path), options.executor()
    names = ["rows.csv", *(["rows.parquet"] if options.parquet else []), *results.drawn(*FIGURES)]
    folder = results.output.folder("sweep", path, [ROWS, *names])
    folder.mkdir(parents=True, exist_ok=True)
    interrupts.saved(f"finished rows are in {folder}: the same command does the others")
    with progress_bar(Path(path).name, len(study)) as bar:

        def report(now: Progress) -> None:
            bad = f"{now.bad} not good, " if now.bad else ""
            bar.update(now.done, f"{bad}{_left(now.left)}")

        run = ad.run_study(study, folder / ROWS, executor, report, again=options.again, sync=options.sync)
    with read_rows(run.file) as rows:
        files = [run.file, write_csv(rows, folder / "rows.csv")]
        if options.parquet:
            files.append(write_parquet(rows, folder / "rows.parquet"))
        table = [flat(row) for row in rows.rows()] if sum(run.counts.values()) <= _MOST_DRAWN else []
    if table and not (results.no_figure or run.interrupted):
        files += _drawn(study, table, folder, Path(path).stem)
    words = facts_table(f"{Path(path).name}: {len(study)} cases", _words(study, run, table, files))
    good = run.counts.keys() <= _ANSWERS
    return judged(_facts(run, good), words, usable=good, files=files)


def _facts(run: StudyRun, good: bool) -> dict[str, object]:
    there = sum(run.counts.values())
    facts: dict[str, object] = {
        "success": good and not run.interrupted,
        "status": "interrupted" if run.interrupted else "done" if good else "not_usable",
        "cases": run.cases,
        "done": there,
        "statuses": run.counts,
        "done_here": run.done_here,
        "seconds": round(run.seconds, 3),
    }
    if run.interrupted:
        facts["message"] = f"interrupted with {there} of {run.cases} rows"
    return facts


def _drawn(study: Study, table: list[dict[str, Any]], folder: Path, title: str) -> list[Path]:
    from armdyn.show.figures.sweeps import figures_of
    from armdyn.show.plots import save_figures
    from armdyn.studies.settings import label

    settings = {axis.name: axis.kind for axis in study.axes}
    drawn = figures_of(table, settings, _outcomes(study), named=label, title=title)
    return [file for name, figure in drawn.items() for file in save_figures(figure, folder / name, ("png", "pdf"))]


def _words(study: Study, run: StudyRun, table: Sequence[Mapping[str, Any]], files: Sequence[Path]) -> dict[str, str]:
    """A study in words."""
    from armdyn.studies.settings import label, unit_of

    def setting(name: str, value: float | str) -> str:
        return f"{name} {value}" if isinstance(value, str) else f"{name} {value:g} {unit_of(name)}".rstrip()

    there = sum(run.counts.values())
    words = {
        "rows": f"{there} of {run.cases}: "
        + ", ".join(f"{n} {name.replace('_', ' ')}" for name, n in run.counts.items()),
        "this run": f"{run.done_here} rows in {run.seconds:.1f} s",
    }
    main = _outcomes(study)[0]
    numbers = [row for row in table if row.get(main) is not None]
    if numbers:
        for word, pick in (("lowest", min), ("highest", max)):
            row = pick(numbers, key=lambda one: one[main])
            at = ", ".join(setting(axis.name, row[axis.name]) for axis in study.axes)
            words[f"{word} {label(main).partition(' [')[0]}"] = f"{row[main]:.6g} s at {at} (case {row['k']})"
    for row in [row for row in table if row["status"] not in _ANSWERS][:3]:
        words[f"case {row['k']}"] = f"{row['status'].replace('_', ' ')}: {row['message']}"
    return words | {"results": str(files[0].parent), "written": ", ".join(file.name for file in files)}


def _outcomes(study: Study) -> tuple[str, str]:
    """Columns of the task's main outcome and of its second outcome."""
    from armdyn.studies.tasks.registry import TASKS

    return TASKS[str(study.task.description()["task"])].outcomes


def _left(left: tuple[float, float] | None) -> str:
    """The remaining time, to its accuracy."""
    if left is None:
        return "time left not yet known"
    least, most = left
    unit, size = next((u, s) for u, s in (("h", 3600.0), ("min", 60.0), ("s", 1.0)) if most >= 2 * s or u == "s")
    words = [f"{time / size:.0f}" for time in (least, most)]
    return f"{words[1]} {unit} left" if words[0] == words[1] else f"{words[0]} to {words[1]} {unit} left"
