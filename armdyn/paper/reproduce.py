"""Reproduction of the whole paper: cases solved in parallel, stored as they finish, and their files."""

from collections import Counter
from collections.abc import Callable, Collection, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from armdyn.errors import DiskFullError
from armdyn.files import probe_folder
from armdyn.optimal import Status
from armdyn.paper.outcomes.case import Case
from armdyn.paper.outcomes.outcome import Outcome
from armdyn.paper.outcomes.run import run_case
from armdyn.paper.outcomes.store import load_outcome, save_outcome
from armdyn.paper.parallel import as_completed
from armdyn.paper.plan import Plan, neighbour
from armdyn.paper.printed.examples import PAYLOADS
from armdyn.paper.printed.loop import PAPER_RULE
from armdyn.paper.tables.files import write_findings, write_methods, write_tables
from armdyn.paper.tables.rows import Row, all_rows
from armdyn.paper.tables.standing import VERDICTS, standings

if TYPE_CHECKING:
    from armdyn.paper.page.figures import Picture

Job = Callable[[], "Outcome | Picture | DiskFullError"]


@dataclass(frozen=True)
class Reproduced:
    """Results of a plan.

    Attributes:
        outcomes: of its cases.
        rows: of Tables 3 to 7.
        files: written.
    """

    outcomes: tuple[Outcome, ...]
    rows: tuple[Row, ...]
    files: tuple[Path, ...] = field(repr=False)

    def summary(self) -> dict[str, object]:
        """The results as JSON."""
        # A time-energy optimum without torque limit that resists is a finding of its own, and the tables say so.
        failed = [o.case.name for o in self.outcomes if o.case.kind == "minimum_time" and not o.success]
        verdicts = [row.verdict for row in self.rows]
        return {
            "success": not failed,
            "status": "done" if not failed else "not_converged",
            "failed": failed,
            "cases": {o.case.name: {"time": o.time, "status": o.status, "message": o.message} for o in self.outcomes},
            "verdicts": {verdict: verdicts.count(verdict) for verdict in ("reproduced", "close", "not reproduced")},
            "files": [str(file) for file in self.files],
        }

    def message(self) -> str:
        """Number of the paper's numbers that are reproduced, in a sentence."""
        found = standings(self.rows)
        if not found:
            return "the paper has no number for the computed cases"
        reproduced, close, missing = (Counter(found.values())[verdict] for verdict in VERDICTS)
        return (
            f"of {len(found)} numbers in the paper's tables {reproduced} are reproduced, {close} nearly, and {missing} "
            f"by no reading of the paper's own data ({len(self.rows)} comparisons)"
        )


def reproduce(
    folder: Path,
    plan: Plan,
    done: Callable[[Outcome, int, int], None] | None = None,
    shown: Callable[[Sequence[Outcome]], None] | None = None,
) -> Reproduced:
    """Carry a plan out. Cases on disk are not solved again; after Ctrl-C finished cases stay there.

    Writes `cases/` (every outcome), a folder for each example with the figures' payload, `tables/`,
    `figures/` and `index.html`; the page for a first time as soon as the figures are drawn.

    Args:
        folder: made if it is not there.
        plan: the cases, figures and tables.
        done: called with each outcome, the number of finished cases, and the number of all.
        shown: called once with the outcomes of the figures' payload, when their page and folders are written.

    Raises:
        KeyboardInterrupt: Ctrl-C; finished cases are on disk, running ones are lost.
        FileError: the folder, or one in it, cannot be written; nothing is solved then.
        DiskFullError: there is no room for a file.
        OSError: a file cannot be written.
    """
    # Not before something is to be drawn, but once for all processes that are forked from this one.
    from armdyn.paper.page.page import write_page

    cases = plan.cases()
    for name in ("cases", "tables", "figures", *{case.paper_example.folder for case in cases}):
        probe_folder(folder / name)
    probe_folder(folder, "index.html").mkdir(parents=True, exist_ok=True)
    jobs, after = _jobs(folder, plan, cases)
    so_far = _SoFar(plan, cases)
    with closing(as_completed(jobs, plan.workers, after)) as results:
        for result in results:
            outcome = so_far.take(result)
            if done and outcome is not None:
                done(outcome, len(so_far.found), len(cases))
            if first := so_far.first():
                if len(so_far.found) < len(cases):
                    write_page(folder, so_far.outcomes, so_far.rows, plan.shown_payload, so_far.pictures)
                if shown:
                    shown(first)
    outcomes, rows = so_far.outcomes, so_far.rows
    folders = [folder / case.paper_example.folder for case in cases if _has_folder(case, plan)]
    files = [file for one in folders for file in sorted(one.iterdir())]
    files += write_tables(folder / "tables", rows)
    files += write_methods(folder / "tables", outcomes)
    if not plan.only:
        files += write_findings(folder / "tables")
    files += write_page(folder, outcomes, rows, plan.shown_payload, so_far.pictures)
    return Reproduced(outcomes, rows, tuple(files))


class _SoFar:
    """Results of a plan so far.

    Attributes:
        found: outcomes by their cases.
        pictures: figures drawn.
    """

    def __init__(self, plan: Plan, cases: Sequence[Case]):
        self.found: dict[Case, Outcome] = {}
        self.pictures: list[Picture] = []
        self._plan, self._cases, self._reported = plan, cases, False
        self._figures = len(_figures(plan, cases))

    def take(self, result: "Outcome | Picture | DiskFullError") -> Outcome | None:
        """Add one result; returned if it is an outcome.

        Raises:
            DiskFullError: it is that.
            KeyboardInterrupt: it reached the solve.
        """
        if isinstance(result, DiskFullError):
            raise result
        if not isinstance(result, Outcome):
            self.pictures.append(result)
            return None
        if result.status == Status.INTERRUPTED:
            raise KeyboardInterrupt
        self.found[result.case] = result
        return result

    @property
    def outcomes(self) -> tuple[Outcome, ...]:
        """The outcomes, in the order of the cases."""
        return tuple(self.found[case] for case in self._cases if case in self.found)

    @property
    def rows(self) -> tuple[Row, ...]:
        """Rows of the plan's tables."""
        rows = all_rows(self.outcomes, self._plan.payloads or PAYLOADS)
        return tuple(row for row in rows if self._plan.includes(row.table))

    def first(self) -> tuple[Outcome, ...]:
        """Outcomes with the figures' payload, returned once: when all are there and drawn; else none."""
        shown = [case for case in self._cases if case.payload == self._plan.shown_payload]
        if self._reported or len(self.pictures) < self._figures or not self.found.keys() >= set(shown):
            return ()
        self._reported = True
        return tuple(self.found[case] for case in shown)


def _figures(plan: Plan, cases: Sequence[Case]) -> dict[int, list[Case]]:
    """The figures that there are to draw, by the paper's numbers, and which cases each shows."""
    from armdyn.paper.page.figures import EXAMPLE_OF_FIGURE, drawn_cases

    figures = {}
    for number in EXAMPLE_OF_FIGURE:
        drawn = drawn_cases(number, plan.shown_payload)
        figures[number] = [case for case in cases if replace(case, arrival_rule=PAPER_RULE) in drawn]
    return {number: drawn for number, drawn in figures.items() if drawn}


def _jobs(folder: Path, plan: Plan, cases: Sequence[Case]) -> tuple[list[Job], dict[int, Collection[int]]]:
    """Cases to solve and, after those that they show, figures to draw; and which wait for which."""
    shown, figures = plan.shown_payload, _figures(plan, cases)
    first = [case for case in cases if case.payload == shown]
    items: list[Case | int] = [*first, *figures, *(case for case in cases if case.payload != shown)]
    place = {item: k for k, item in enumerate(items) if isinstance(item, Case)}
    jobs, after = list[Job](), dict[int, Collection[int]]()
    for k, item in enumerate(items):
        if isinstance(item, Case):
            near = neighbour(item, cases, shown)
            after[k] = [place[near]] if near else []
            jobs.append(partial(_work, folder, item, near, _has_folder(item, plan), plan.fresh))
        else:
            after[k] = [place[case] for case in figures[item]]
            jobs.append(partial(_drawn, folder, item, figures[item], shown))
    return jobs, after


def _drawn(folder: Path, number: int, cases: Sequence[Case], payload: float) -> "Picture | DiskFullError":
    """One of the figures, of cases that are on disk."""
    from armdyn.paper.page.figures import paper_figures, picture

    outcomes = [load_outcome(folder / "cases", case) for case in cases]
    drawn = paper_figures([outcome for outcome in outcomes if outcome], payload)
    try:
        return picture(folder / "figures", next(figure for figure in drawn if figure.number == number))
    except DiskFullError as error:
        return error


def _work(folder: Path, case: Case, near: Case | None, with_folder: bool, fresh: bool) -> Outcome | DiskFullError:
    """One case, from disk if it is there. A full disk is returned: a job that raises would be done again."""
    kept = None if fresh else load_outcome(folder / "cases", case)
    nearest = None if kept or near is None else load_outcome(folder / "cases", near)
    outcome = kept or run_case(case, workers=1, near=nearest)  # the other cores have cases of their own
    if outcome.status == Status.INTERRUPTED:
        return outcome
    try:
        _keep(folder, outcome, kept is not None, with_folder)
    except DiskFullError as error:
        return error
    return outcome


def _keep(folder: Path, outcome: Outcome, kept: bool, with_folder: bool) -> None:
    """Write an outcome, unless it is kept already, and its example's folder."""
    if not kept:
        save_outcome(folder / "cases", outcome)
    own = folder / outcome.case.paper_example.folder
    if with_folder and outcome.trajectory is not None and not (kept and (own / "result.json").exists()):
        from armdyn.paper.page.example import write_example

        write_example(own, outcome)


def _has_folder(case: Case, plan: Plan) -> bool:
    """Whether a case is one of the six examples as the paper states them, with the figures' payload."""
    stated = Case(case.example, case.arm, case.paper_example.kind, plan.shown_payload, arrival_rule=case.arrival_rule)
    return case == stated
